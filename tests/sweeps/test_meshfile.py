"""Mesh files as parameters."""

from pathlib import Path

import numpy as np
import pytest

from solver import registry
from solver.decay.surfaces.surface import geodesic
from sweeps.commands.terminal.options import assignments, parameters
from sweeps.errors import InvalidOption

trimesh = pytest.importorskip("trimesh")


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "stl"])
def test_a_mesh_comes_with_shared_points(kind: str, tmp_path: Path) -> None:
    points, faces = geodesic(4)
    trimesh.Trimesh(points, faces, process=False).export(tmp_path / f"a.{kind}")
    found = assignments([f"mesh=@{tmp_path}/a.{kind}"])["mesh"]
    # STL has three points of its own per triangle
    assert np.shape(found["points"]) == points.shape
    ours = np.array(found["points"])[np.array(found["faces"])].mean(axis=1)
    theirs = points[faces].mean(axis=1)
    assert np.abs(np.sort(ours, axis=0) - np.sort(theirs, axis=0)).max() < 1e-6


def test_what_is_no_mesh_is_refused(tmp_path: Path) -> None:
    for name, text in (("a.txt", "x"), ("b.obj", "v 0 0 0\n"), ("c.ply", "nonsense")):
        (tmp_path / name).write_text(text)
        with pytest.raises(InvalidOption):
            assignments([f"mesh=@{tmp_path}/{name}"])
    with pytest.raises(InvalidOption):
        assignments([f"mesh=@{tmp_path}/none.obj"])


def test_a_mesh_without_a_surface_is_refused_in_our_words(tmp_path: Path) -> None:
    """Its triangles are lines: as parameters it was refused as a list that is too short."""
    (tmp_path / "line.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 0 0\nv 0 0 0\nf 1 2 3\nf 1 2 4\n")
    with pytest.raises(InvalidOption, match=r"^line\.obj: no triangle of it has three places\. Take one"):
        assignments([f"mesh=@{tmp_path}/line.obj"])


def test_a_params_file_names_meshes_beside_it(tmp_path: Path) -> None:
    """As of a body that a wood's set-up holds, at any depth, whatever the present folder."""
    points, faces = geodesic(3)
    trimesh.Trimesh(0.02 * points, faces, process=False).export(tmp_path / "ball.obj")
    text = 'bodies = [{ shape = "mesh", mesh = "@ball.obj", path = [{ time = 0, position = [0.07, 0, 0.1] }] }]\n'
    (tmp_path / "a.toml").write_text(text)
    values = parameters(tmp_path / "a.toml")
    assert np.shape(values["bodies"][0]["mesh"]["points"]) == points.shape
    assert registry.get("wood").parse(values).model_dump()["bodies"][0]["mesh"]["points"]
    (tmp_path / "b.toml").write_text(text.replace("ball", "none"))
    with pytest.raises(InvalidOption, match=r"none\.obj"):
        parameters(tmp_path / "b.toml")
