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
