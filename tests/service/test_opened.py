"""Fruits cut open: what the files hold, read by trimesh and by the glTF document, against closed forms."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr
from PIL import Image
from scipy.spatial import Delaunay
from typer.testing import CliRunner

from service.cli import app
from service.errors import InvalidQuery
from service.sequences import Options, prepared
from solver.contract import Need
from solver.decay import SOLVER
from store import shards

from ._gltf import accessor, parsed
from ._runs import made, rotting, shrinking, wizen

#: A plane off the middle that no axis lies in, and how far it is from the middle.
NORMAL = np.array([1.0, 2.0, 2.0]) / 3
OFF = 0.3


def cut(off: float = OFF) -> str:
    return ",".join(repr(float(x)) for x in (*(off * NORMAL), *(5 * NORMAL)))


def opened(run: xr.Dataset) -> trimesh.Trimesh:
    mesh = trimesh.load(io.BytesIO(made(run, "ply", cut=cut())), file_type="ply", process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def test_a_ball_without_its_cap_is_closed_and_as_large_as_it_should_be() -> None:
    run = rotting(32)
    whole = trimesh.load(io.BytesIO(made(run, "ply")), file_type="ply", process=False)
    found = opened(run)
    height = found.vertices @ NORMAL
    assert height.max() == pytest.approx(OFF, abs=1e-6)  # nothing is left of the half that goes
    assert height.min() == pytest.approx((whole.vertices @ NORMAL).min(), abs=1e-6)
    closed = trimesh.Trimesh(found.vertices, found.faces)
    closed.merge_vertices(digits_vertex=6)
    assert closed.is_watertight
    assert closed.is_winding_consistent
    # a ball of .8 about .6, 0, 0 less a cap; its facets lie within it by .3 %
    radius, off = 0.8, OFF - 0.6 * NORMAL[0]
    cap = radius - off
    assert closed.volume == pytest.approx(np.pi * (4 / 3 * radius**3 - cap**2 * (radius - cap / 3)), rel=6e-3)
    face = (np.abs(height[found.faces] - OFF) < 1e-6).all(axis=1)
    assert (found.face_normals[face] @ NORMAL).min() > 0.999
    assert found.area_faces[face].sum() == pytest.approx(np.pi * (radius**2 - off**2), rel=6e-3)


def test_a_fruit_that_keeps_its_shape_is_cut_open_where_it_was_fresh() -> None:
    """A run of the default fields holds no position, for nothing moves; one that moves is refused, and says it once."""
    params = SOLVER.parse({}, preset="apple")
    run = SOLVER.solve(params, Need(quality="preview", resolution=16, stages=(4.0,), fields=("rot", "mould")))
    assert "position" not in run
    found = opened(run)
    there = SOLVER.solve(
        params, Need(quality="preview", resolution=16, stages=(4.0,), fields=("rot", "mould", "position"))
    )
    assert np.array_equal(found.vertices, opened(there).vertices)
    moves = run.assign_attrs(params=SOLVER.parse({"body": "quasi-static"}, preset="apple").model_dump_json())
    with pytest.raises(InvalidQuery) as refused:
        opened(moves)
    assert str(refused.value).count("no surface to cut") == str(refused.value).count("Ask for the field") == 1


def test_rot_goes_as_deep_as_the_body_says() -> None:
    """The law of the body: what the skin above has, times 1 - depth / rot_depth; read off the file's own columns."""
    run = rotting(16)
    rows = opened(run).metadata["_ply_raw"]["vertex"]["data"]
    points = np.stack([rows[axis].ravel() for axis in "xyz"], -1)
    flesh, rot, mould = (rows[name].ravel() for name in ("flesh", "rot", "mould"))
    assert set(np.unique(flesh)) == {0.0, 1.0}
    assert (mould[flesh == 1] == 0).all()
    assert np.abs(points[flesh == 1] @ NORMAL - OFF).max() < 1e-6
    deep = json.loads(run.attrs["params"])["flesh"]["rot_depth"]
    skin = trimesh.load(io.BytesIO(made(run, "ply")), file_type="ply", process=False)
    column = skin.metadata["_ply_raw"]["vertex"]["data"]["rot"].ravel()
    away = np.linalg.norm(points[flesh == 1][:, None] - skin.vertices[None], axis=2)
    most = np.array([column[row < row.min() + 0.4].max() for row in away])
    fades = np.clip(1 - away.min(axis=1) / deep, 0, 1)
    assert (rot[flesh == 1] <= most * fades + 1e-5).all()
    assert rot[flesh == 1].max() > 0.2
    assert rot[flesh == 1][fades == 0].max(initial=0) == 0


def test_a_cut_face_has_what_the_flesh_has_there() -> None:
    """Rot of the flesh's own that is no law of depth: linear across it, which its tetrahedra hold exactly."""
    run = rotting(16)
    axes = np.linspace(-0.6, 1.8, 7)
    points = np.stack(np.meshgrid(axes, axes, axes), -1).reshape(-1, 3)
    slope = np.array([0.2, -0.1, 0.15])
    stages = run.sizes["stage"]
    run = run.assign(
        flesh_position=(("stage", "flesh_point", "component"), np.tile(points, (stages, 1, 1))),
        flesh_cell=(
            ("flesh_tetrahedron", "flesh_corner"),
            Delaunay(points + 1e-3 * np.sin(9 * points[:, ::-1])).simplices,
        ),
        flesh_rot=(("stage", "flesh_point"), np.tile(0.4 + points @ slope, (stages, 1))),
    )
    rows = opened(run).metadata["_ply_raw"]["vertex"]["data"]
    found = np.stack([rows[axis].ravel() for axis in "xyz"], -1)
    flesh, rot = (rows[name].ravel() for name in ("flesh", "rot"))
    assert np.allclose(rot[flesh == 1], 0.4 + found[flesh == 1] @ slope, atol=1e-5)


def test_flesh_is_paler_than_skin_and_brown_where_it_rots() -> None:
    document, binary = parsed(made(rotting(32), "animation", cut=cut(), stage=5.0))
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    colour = accessor(document, binary, attributes["COLOR_0"])[:, :3]
    flesh = accessor(document, binary, attributes["_FLESH"])[:, 0] == 1
    rot = accessor(document, binary, attributes["_ROT"])[:, 0]
    sound, rotten = flesh & (rot < 0.001), flesh & (rot > 0.2)
    assert sound.any()
    assert rotten.any()
    # tan, not dark: soft rot by P. expansum, whose lesions have a colour of their own
    assert colour[rotten].mean(axis=0).sum() < 0.6 * colour[sound].mean(axis=0).sum()
    assert (np.diff(colour[rotten].mean(axis=0)) < -0.1).all(), "brown: more red than green, more green than blue"


def test_all_days_are_cut_and_caches_refuse() -> None:
    document, _ = parsed(made(rotting(16), "animation", cut=cut()))
    assert len(document["meshes"]) == 3
    run = rotting(16)
    assert [len(s.triangles) > 0 for s in prepared(run, Options.parse({"cut": cut()}))] == [True] * 3
    assert len(prepared(run, Options.parse({"cut": cut()}), 2.0)) == 1


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("0,0,0", "six numbers"),
        ("0,0,0,0,0,0", "six numbers"),
        ("a", "six"),
        ("0,0,9,0,0,1", "misses"),
        ("nan," * 6, ""),
    ],
)
def test_what_is_no_plane_through_the_fruit_is_refused(text: str, why: str) -> None:
    with pytest.raises(InvalidQuery, match="cut") as caught:
        prepared(rotting(16), Options.parse({"cut": text}))
    assert why in json.dumps(caught.value.__dict__, default=str)


def test_nothing_is_made_up_of_an_inside_that_nobody_knows() -> None:
    with pytest.raises(InvalidQuery, match="inside"):
        prepared(shrinking().assign_attrs(solver="dehydration"), Options.parse({"cut": cut()}))


def test_commands_cut_a_run_open(tmp_path: Path) -> None:
    words = "solve decay --preset apple --quality preview --resolution 24 --stages 0,6 --cut 0,0,0,0,0,1 --out"
    wizen(*words.split(), str(tmp_path / "open.png"))
    with Image.open(tmp_path / "open.png") as picture:
        assert picture.size[0] > 1.5 * picture.size[1]  # two days side by side
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    # the middle of the first day is pale flesh, not the apple's red skin
    red, green, _ = pixels[pixels.shape[0] // 2, pixels.shape[1] // 4]
    assert green > 0.75 * red
    done = CliRunner().invoke(app, [*words.replace("0,0,0,0,0,1", "0,0,1").split(), str(tmp_path / "not.png")])
    assert done.exit_code == 2
    assert "six numbers" in done.output
    run = SOLVER.solve(
        SOLVER.parse({}, "apple"),
        SOLVER.settle(Need(stages=(0.0, 4.0), quality="preview", resolution=16, fields=("rot", "mould", "position"))),
    )
    shards.write(tmp_path / "run.h5", run, "0" * 64)
    for suffix in (".glb", ".obj", ".usdc"):
        wizen("export", str(tmp_path / "run.h5"), "--cut", "0,0,0,0,0,1", "--out", str(tmp_path / f"a{suffix}"))
    half = trimesh.load(tmp_path / "a.obj", process=False)
    assert half.vertices[:, 2].max() < 1e-5
