"""A user's mesh moved by a result: known motions of spheres, and files in their own order of vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr

from service.errors import InvalidQuery, UnfitFormat
from service.sequences import of_run
from service.sequences.imported import bind, load
from solver import meshes
from solver.fruit import directions, lattice
from solver.geometry.nearest import nearest


def moving(n: int) -> xr.Dataset:
    """A unit ball, and what the map x -> bent(x) makes of it."""
    ball = directions(*lattice(n))
    data = {"position": (("stage", "colatitude", "azimuth", "component"), np.stack([ball, bent(ball)]).astype("f4"))}
    return xr.Dataset(data, {"stage": [0.0, 1.0]})


def bent(ball: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(ball, -1, 0)
    return np.stack([x * (0.7 + 0.1 * y), y - 0.2 * x * z, z * (0.8 - 0.1 * x)], axis=-1)


@pytest.mark.parametrize("binding", ["nearest", "direction"])
def test_a_sphere_of_other_triangles_moves_as_the_ball_does(binding: str) -> None:
    user = trimesh.creation.icosphere(subdivisions=4)
    points, shift = np.array(user.vertices), np.array([10.0, -3.0, 2.0])
    errors = []
    for n in (16, 32, 64):
        sequence = of_run(moving(n))
        bound = bind(25 * points + shift, user.faces, sequence, binding)
        last = list(sequence)[-1]
        errors.append(np.abs((bound.moved(last) - shift) / 25 - bent(points)).max())
        assert bound.scale == pytest.approx(1 / 25, rel=1 / n**2)
        assert bound.report()["gap_max"] < 2 / n**2
    # linear on the result's triangles: second order in their size
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.4)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.4)


def test_by_direction_a_smaller_copy_moves_in_proportion() -> None:
    user = trimesh.creation.icosphere(subdivisions=3)
    sequence = of_run(moving(64))
    bound = bind(0.5 * np.array(user.vertices), user.faces, sequence, "direction", "none")
    assert np.allclose(bound.moved(list(sequence)[-1]), 0.5 * bent(np.array(user.vertices)), atol=1e-3)
    assert bound.report()["gap_max"] == pytest.approx(0.5 / np.sqrt(12), abs=1e-3)


def test_nearest_is_nearest_on_a_mesh_of_very_uneven_triangles() -> None:
    generator = np.random.default_rng(3)
    vertices = generator.normal(size=(60, 3)) * [1, 5, 0.1]
    triangles = generator.integers(0, 60, (80, 3))
    triangles = triangles[np.ptp(triangles, axis=1) > 0]
    triangles = triangles[[len(set(t)) == 3 for t in triangles.tolist()]]
    points = generator.normal(size=(50, 3)) * [1, 5, 1]
    found = nearest(points, vertices, triangles)
    # every triangle, densely sampled: independent of any formula for the nearest point
    a, b = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 31), np.linspace(0, 1, 31)))
    shares = np.stack([a, b, 1 - a - b], axis=-1)[a + b <= 1 + 1e-12]
    dense = np.einsum("sk,fkc->fsc", shares, vertices[triangles]).reshape(-1, 3)
    sampled = np.sqrt(((points[:, None] - dense) ** 2).sum(axis=2).min(axis=1))
    assert (found.distance <= sampled + 1e-9).all()
    assert (found.distance >= sampled - 0.4).all()
    places = np.einsum("pk,pkc->pc", found.shares, vertices[triangles[found.face]])
    assert np.allclose(np.linalg.norm(places - points, axis=1), found.distance, atol=1e-6)


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "glb"])
def test_meshes_of_every_kind_are_read(kind: str, tmp_path: Path) -> None:
    box = trimesh.creation.box()
    path = tmp_path / f"box.{kind}"
    box.export(path)
    points, faces = load(path)
    assert trimesh.Trimesh(points, faces).volume == pytest.approx(1)


def test_an_obj_keeps_its_vertices_in_order_and_its_polygons_are_cut(tmp_path: Path) -> None:
    path = tmp_path / "quad.obj"
    path.write_text("v 3 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nvt 0 0\nvt 1 1\nv 0 1 0\nf 1/1 2/2 3/1 -1/2\n")
    points, faces = load(path)
    assert points.tolist() == [[3, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("text", ["", "v 0 0 0\n", "v 0 0 0\nf 1 2 3\n", "v a b c\n", "v nan 0 0\nf 1 1 1\n"])
def test_damaged_meshes_are_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.obj"
    path.write_text(text)
    with pytest.raises(InvalidQuery, match="cannot be read"):
        load(path)
    with pytest.raises(InvalidQuery, match="no mesh"):
        load(tmp_path / "bad.doc")


def test_changing_triangles_move_no_mesh() -> None:
    box = trimesh.creation.box()
    points, faces = np.array(box.vertices), np.array(box.faces)
    frames = [meshes.Frame(points, faces, {}), meshes.Frame(points, np.roll(faces, 1, axis=0), {})]
    run = xr.Dataset(meshes.changing(frames), {"stage": [0.0, 1.0]})
    with pytest.raises(UnfitFormat, match="stay"):
        bind(points, faces, of_run(run))


def test_triangles_that_might_change_and_do_not_move_a_mesh() -> None:
    """As growth without remeshing, whose own vertices a cache had all along."""
    box = trimesh.creation.box()
    points, faces = np.array(box.vertices), np.array(box.faces)
    frames = [meshes.Frame(points, faces, {}), meshes.Frame(points * [1, 2, 3], faces, {})]
    sequence = of_run(xr.Dataset(meshes.changing(frames), {"stage": [0.0, 1.0]}))
    bound = bind(points / 2, faces, sequence)
    assert np.allclose(bound.moved(list(sequence)[-1]), points / 2 * [1, 2, 3])


def test_a_vertex_in_the_centre_has_no_direction() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    with pytest.raises(InvalidQuery, match="direction"):
        bind(points, np.array([[0, 1, 3], [0, 2, 4]]), of_run(moving(8)))
    bound = bind(points, np.array([[0, 1, 3], [0, 2, 4]]), of_run(moving(8)), "nearest")
    assert np.isfinite(bound.moved(list(of_run(moving(8)))[-1])).all()
