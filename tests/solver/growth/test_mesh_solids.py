"""Closed meshes as solids: how deep, which way out, and a sheet that lies on them as on what they are meshes of."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from solver.contract import InvalidInput
from solver.geometry.signed import Signed
from solver.growth import SOLVER
from solver.growth.params import GrowthParams
from solver.growth.solids import SolidBox, SolidMesh

from .test_growth import grow


def meshed(made: trimesh.Trimesh, **values: object) -> dict[str, object]:
    made.merge_vertices()
    mesh = {"points": made.vertices.tolist(), "faces": made.faces.tolist()}
    return {"kind": "mesh", "mesh": mesh, **values}


def wound(x: np.ndarray, made: trimesh.Trimesh) -> np.ndarray:
    """How often a mesh goes round points, by the solid angles of its triangles (van Oosterom and Strackee 1983)."""
    turns = np.zeros(len(x))
    for a, b, c in made.vertices[made.faces]:
        p, q, r = a - x, b - x, c - x
        lp, lq, lr = (np.linalg.norm(v, axis=1) for v in (p, q, r))
        below = lp * lq * lr + (p * q).sum(1) * lr + (q * r).sum(1) * lp + (r * p).sum(1) * lq
        turns += np.arctan2((p * np.cross(q, r)).sum(1), below) / (2 * np.pi)
    return turns


@pytest.mark.parametrize(
    "made",
    [trimesh.creation.box((1, 0.8, 0.6)), trimesh.creation.torus(1, 0.3, 24, 12), trimesh.creation.cone(0.3, 1)],
    ids=["box", "torus", "cone"],
)
def test_what_is_inside_is_what_the_mesh_goes_round(made: trimesh.Trimesh) -> None:
    """Corners, edges and faces alike; and the way out leads to the surface, over just the depth."""
    made.merge_vertices()
    signed = Signed(np.array(made.vertices), np.array(made.faces))
    x = np.random.default_rng(0).uniform(-1.4, 1.4, (4000, 3))
    depth, way = signed.depth(x)
    inside = wound(x, made) > 0.5
    assert 10 < inside.sum() < len(x)
    assert ((depth > 0) == inside).all()
    assert np.linalg.norm(way, axis=1) == pytest.approx(np.ones(len(x)))
    assert np.abs(signed.depth(x + depth[:, None] * way)[0]).max() < 1e-12


def test_a_mesh_of_a_box_is_as_deep_as_the_box() -> None:
    x = np.array([1.0, 2, 3]) + np.random.default_rng(1).uniform(-0.6, 0.6, (2000, 3))
    mesh = SolidMesh.model_validate(meshed(trimesh.creation.box((1, 0.8, 0.6)), centre=(1, 2, 3)))
    box = SolidBox(centre=(1, 2, 3), size=(1, 0.8, 0.6), edge=0)
    (deep, way), (wanted, out) = mesh.depth(x), box.depth(x)
    assert deep == pytest.approx(wanted, abs=1e-12)
    assert (wanted > 0).sum() > 300
    assert way[wanted > 0] == pytest.approx(out[wanted > 0], abs=1e-9)
    assert 0.15 < mesh.thick <= 0.3


def test_the_mesh_of_a_ball_that_rises_lifts_a_sheet_as_the_ball_does() -> None:
    """A sphere of 1,280 triangles is 0.4 % flatter than the ball at most; a sheet held all round has one shape."""
    held = [{"where": {"kind": "rim", "width": 0.1}}]
    common = {"shape": "disc", "thickness": 0.02, "curved": False, "attached": held, "step": 0.1}
    way = {"centre": (0.1, 0, -0.75), "velocity": (0, 0, 1.0)}
    ball = {"kind": "ball", "radius": 0.5, **way}
    mesh = meshed(trimesh.creation.icosphere(3, 0.5), **way)
    shapes = [grow(300, 0.5, solids=[solid], **common).state.x for solid in (ball, mesh)]
    assert shapes[0][:, 2].max() == pytest.approx(0.25, abs=0.03)
    assert shapes[1] == pytest.approx(shapes[0], abs=0.005)


def test_a_mesh_that_is_open_or_too_fast_is_refused() -> None:
    made = meshed(trimesh.creation.icosphere(1, 0.5))
    opened = {**made, "mesh": {**made["mesh"], "faces": made["mesh"]["faces"][1:]}}  # type: ignore[dict-item, index]
    with pytest.raises(InvalidInput, match="the mesh is open"):
        SOLVER.parse({"solids": [opened]})
    with pytest.raises(InvalidInput, match="could pass through the sheet"):
        SOLVER.parse({"solids": [{**made, "velocity": (0, 0, 10)}], "step": 0.1})
    assert isinstance(SOLVER.parse({"solids": [{**made, "velocity": (0, 0, 1)}], "step": 0.1}), GrowthParams)
