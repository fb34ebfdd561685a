"""A branch and what hits it, as a user gets them: one command for a clip, and clips of what was stored without one."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom
from typer.testing import CliRunner

from service.cli import app
from store import shards

from ._runs import wizen

#: A block meets a branchlet at some 12 ms.
TWIG = ["solve", "wood", "--preset", "twig", "--set", "rods=7", "--set", "vertices=12", "--quality", "preview"]
TWIG += ["--stages", "0,0.005", "--out"]


def parts(points: np.ndarray, faces: np.ndarray) -> tuple[float, int]:
    """Return the least height [m] of the block, which is as long as nothing else, and how many pieces there are."""
    mesh = trimesh.Trimesh(points, faces)
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    pieces = mesh.split(only_watertight=False)
    blocks = [p for p in pieces if np.sort(p.extents) == pytest.approx([0.01, 0.01, 0.06], rel=2e-3)]
    assert len(blocks) == 1
    return float(blocks[0].bounds[0, 1]), len(pieces)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("twig") / "twig.glb"
    wizen(*TWIG, str(path))
    return path


def test_one_command_writes_a_clip_with_the_body_in_it(clip: Path) -> None:
    found = trimesh.load(clip).geometry
    assert sorted(found) == ["wood 0", "wood 0.005"]
    low = [parts(np.asarray(found[n].vertices), found[n].faces) for n in sorted(found)]
    # it comes down by 10 cm in 50 ms, and y is up in the file
    assert low[0][0] == pytest.approx(0.05 - 0.005, abs=2e-4)
    assert low[1][0] == pytest.approx(0.04 - 0.005, abs=2e-4)
    assert [n for _, n in low] == [2, 2]
    # the block is grey, the bark is not
    colours = np.asarray(found["wood 0"].visual.vertex_attributes["color"])[:, :3].astype(float)
    block = np.asarray(found["wood 0"].vertices)[:, 1] > 0.035
    grey = np.ptp(colours, axis=1) <= 0.35 * colours.max(1)
    assert block.sum() > 100
    assert grey[block].all()
    assert not grey[~block].any()


def test_a_run_that_was_stored_without_its_surface_is_exported_all_the_same(clip: Path, tmp_path: Path) -> None:
    bare = tmp_path / "twig.h5"
    wizen(*TWIG, str(bare), "--fields", "body_impulse,tip_position")
    assert "mesh_position" not in shards.read(bare)
    said = wizen("export", str(bare), "--out", str(tmp_path / "again.glb"))
    assert "written" in said
    assert (tmp_path / "again.glb").stat().st_size == clip.stat().st_size
    wizen("export", str(bare), "--out", str(tmp_path / "again.usdc"))
    stage = Usd.Stage.Open(str(tmp_path / "again.usdc"))
    points = UsdGeom.Mesh(stage.GetDefaultPrim()).GetPointsAttr()
    first, last = (np.array(points.Get(points.GetTimeSamples()[n])) for n in (0, -1))
    block = first[:, 1] > 0.035
    assert (first[block] - last[block]).mean(0) == pytest.approx([0, 0.01, 0], abs=1e-5)


def test_what_cannot_be_solved_again_is_refused(clip: Path, tmp_path: Path) -> None:
    bare = tmp_path / "old.h5"
    wizen(*TWIG, str(bare), "--fields", "tip_position")
    run = shards.read(bare)
    run.attrs["solver_version"] = "1"
    shards.write(tmp_path / "older.h5", run, "0" * 64)
    done = CliRunner().invoke(app, ["export", str(tmp_path / "older.h5"), "--out", str(tmp_path / "x.glb")])
    assert done.exit_code != 0
    assert "no whole surface" in done.output


def test_a_whole_run_keeps_its_surface_and_tells_bodies_apart(tmp_path: Path) -> None:
    path = tmp_path / "whole.h5"
    wizen(*TWIG, str(path))
    run = shards.read(path)
    assert run["body"].dims == ("vertex",)
    assert "body" in run.data_vars
    assert run["body_impulse"].dims == ("stage", "obstacle", "component")
    assert set(np.unique(run["body"].values)) == {0.0, 1.0}


def test_curves_come_as_a_table_and_as_a_drawing(tmp_path: Path) -> None:
    """A bar drawn by a grip: what stands in the file is E A / L, read by nobody of ours."""
    path = tmp_path / "bar.toml"
    path.write_text(
        "rods = 5\nvertices = 6\nfracture = 'none'\ndamping = 2000.0\n"
        "grips = [{ low = [0.149, -1, -1], high = [1, 1, 1], path = [{ time = 0 }, "
        "{ time = 0.004, shift = [1e-5, 0, 0] }] }]\n"
    )
    words = ("solve", "wood", "--params", str(path), "--stages", "0.003,0.0035,0.004", "--quality", "fine", "--out")
    wizen(*words, str(tmp_path / "bar.csv"))
    with (tmp_path / "bar.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["stage [s]"]) for row in rows] == [0.003, 0.0035, 0.004]
    last = {name: float(value) for name, value in rows[-1].items()}
    assert last["grip_shift 0 x [m]"] == pytest.approx(0.9375e-5)
    stiff = last["grip_force 0 x [N]"] / last["grip_shift 0 x [m]"]
    assert stiff == pytest.approx(10e9 * np.pi * 1e-4 / 0.15, rel=0.05)
    assert last["fragments [1]"] == 1
    assert last["fragment_mass 0 [kg]"] == pytest.approx(600 * np.pi * 1e-4 * 0.15, rel=1e-3)
    wizen(*words, str(tmp_path / "bar.svg"))
    drawn = (tmp_path / "bar.svg").read_text()
    assert drawn.lstrip().startswith("<?xml")
    assert "<path" in drawn
