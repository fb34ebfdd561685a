"""What `wizen solve` writes of a fruit with a body, `wizen export` moves: measured on the files, by other readers."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom
from typer.testing import CliRunner

from service.cli import app
from solver.contract import Need
from solver.decay import SOLVER
from store import shards

BODY = "--preset tomato --quality preview --stages 0,4,8 --set body=quasi-static --set skin={} --set te=0.03"


def wizen(*words: str) -> str:
    done = CliRunner().invoke(app, list(words))
    assert done.exit_code == 0, done.output
    return done.output


def motion(frames: list[np.ndarray]) -> float:
    return max(float(np.linalg.norm(frame - frames[0], axis=1).max()) for frame in frames)


def pc2(data: bytes) -> list[np.ndarray]:
    count, _, _, samples = struct.unpack("<iffi", data[16:32])
    points = struct.unpack(f"<{3 * count * samples}f", data[32:])
    return list(np.array(points).reshape(samples, count, 3))


def mdd(data: bytes) -> list[np.ndarray]:
    frames, count = struct.unpack(">ii", data[:8])
    points = struct.unpack(f">{3 * count * frames}f", data[8 + 4 * frames :])
    return list(np.array(points).reshape(frames, count, 3))


def glb(path: Path) -> list[np.ndarray]:
    found = trimesh.load(path).geometry
    return [np.asarray(found[name].vertices) for name in sorted(found, key=lambda name: float(name.split()[-1]))]


def usd(path: Path) -> list[np.ndarray]:
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.Mesh(stage.GetDefaultPrim()).GetPointsAttr()
    return [np.array(points.Get(time)) for time in points.GetTimeSamples()]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("moving") / "tom.h5"
    wizen("solve", "decay", *BODY.split(), "--set", "firmness=5", "--out", str(path))
    return path


@pytest.mark.parametrize(
    ("suffix", "read"),
    [
        (".pc2", lambda path: pc2(path.read_bytes())),
        (".mdd", lambda path: mdd(path.read_bytes())),
        (".glb", glb),
        (".usdc", usd),
    ],
)
def test_a_body_that_moves_moves_in_every_format(run: Path, suffix: str, read, tmp_path: Path) -> None:
    out = tmp_path / f"tom{suffix}"
    wizen("export", str(run), "--out", str(out))
    frames = read(out)
    assert len(frames) == 3
    # a soft tomato that rots and dries for eight days sinks by more than a twentieth of its radius
    assert motion(frames) > 0.05
    here = shards.read(run)["position"].values.reshape(3, -1, 3)
    assert motion(frames) == pytest.approx(motion(list(here)), rel=0.05)


def test_a_result_that_does_not_say_where_its_surface_is_is_refused(tmp_path: Path) -> None:
    params = SOLVER.parse({"body": "quasi-static"}, "tomato")
    need = SOLVER.settle(Need(fields=("rot",), stages=(0.0, 0.2), quality="preview", resolution=12))
    shards.write(tmp_path / "lean.h5", SOLVER.solve(params, need), "0" * 64)
    for suffix in (".pc2", ".mdd", ".glb", ".usdc", ".obj"):
        done = CliRunner().invoke(app, ["export", str(tmp_path / "lean.h5"), "--out", str(tmp_path / f"a{suffix}")])
        assert done.exit_code == 2
        assert "position" in done.output
        assert not (tmp_path / f"a{suffix}").exists()
    # a map needs no shape
    wizen("export", str(tmp_path / "lean.h5"), "--out", str(tmp_path / "rot.png"), "--size", "16")


def test_who_names_fields_gets_no_others() -> None:
    params = SOLVER.parse({"body": "quasi-static"}, "tomato")
    need = Need(fields=("rot",), stages=(0.2,), quality="preview", resolution=12)
    found = SOLVER.solve(params, need)
    assert "position" not in found
    assert "body_residual" not in found
    still = SOLVER.solve(SOLVER.parse({}, "tomato"), need.model_copy(update={"fields": ()}))
    assert "position" not in still
