"""`wizen solve --out` of several stages as one animated file: what a viewer of ours did not write reads it."""

import json
from pathlib import Path

import pytest
import trimesh
from typer.testing import CliRunner

from service.cli import app

BUNDLE = ("wood", "--set", "rods=8", "--set", "vertices=9", "--set", "bend=0.01", "--stages", "1e-4,2e-4,3e-4")


def solved(path: Path, *words: str) -> object:
    return CliRunner().invoke(app, ["solve", *BUNDLE, "--quality", "preview", "--out", str(path), *words])


def test_a_run_of_several_stages_is_one_animated_clip(tmp_path: Path) -> None:
    path = tmp_path / "clip.glb"
    done = solved(path)
    assert done.exit_code == 0, done.output
    assert len(trimesh.load(path).geometry) == 3
    length = int.from_bytes(path.read_bytes()[12:16], "little")
    document = json.loads(path.read_bytes()[20 : 20 + length])
    assert document["animations"]


def test_it_is_usd_too(tmp_path: Path) -> None:
    usd = pytest.importorskip("pxr.Usd")
    path = tmp_path / "clip.usdc"
    done = solved(path)
    assert done.exit_code == 0, done.output
    stage = usd.Stage.Open(str(path))
    assert stage.GetEndTimeCode() > stage.GetStartTimeCode()
    assert any(prim.GetTypeName() == "Mesh" for prim in stage.Traverse())


def test_a_format_of_one_stage_still_refuses_several(tmp_path: Path) -> None:
    done = solved(tmp_path / "still.obj")
    assert done.exit_code != 0
    assert "holds one stage, not 3" in done.output


def test_a_run_that_does_not_fit_its_file_is_kept(tmp_path: Path) -> None:
    """Whether triangles stay is known when it is solved; what is refused then can be written as something else."""
    pytest.importorskip("pxr")
    done = solved(tmp_path / "clip.usdz")
    assert done.exit_code != 0
    assert "Ask for usdc" in done.output
    (kept,) = tmp_path.iterdir()
    assert kept.name.startswith("clip-")
    assert str(kept) in done.output.replace("\n", "")
    other = CliRunner().invoke(app, ["export", str(kept), "--out", str(tmp_path / "clip.usdc"), "--json"])
    assert other.exit_code == 0, other.output
    assert json.loads(other.output)["stages"] == [1e-4, 2e-4, 3e-4]
    # the same run again is in the same file
    before = kept.read_bytes()
    again = solved(tmp_path / "clip.usdz")
    assert again.exit_code != 0
    assert str(kept) in again.output.replace("\n", "")
    assert kept.read_bytes() == before
