"""What `wizen solve` writes of a fruit with a body, `wizen export` moves: measured on the files, by other readers."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom
from scipy.spatial import KDTree
from typer.testing import CliRunner

from service.cli import app
from solver.contract import Need
from solver.decay import SOLVER
from store import shards

from ._runs import wizen

BODY = "--preset tomato --quality preview --stages 0,4,8 --set body=quasi-static --set skin={} --set te=0.03"


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


# --- vertex by vertex: the cache against the result as h5py reads it, and against the GLB's own numbers ---------------


def stored(path: Path, name: str) -> np.ndarray:
    with h5py.File(path) as file:
        return np.asarray(file[name])


def targets(path: Path) -> list[np.ndarray]:
    """Return what a GLB with morph targets shows of each stage, by the glTF document alone."""
    data = path.read_bytes()
    size = struct.unpack("<I", data[12:16])[0]
    document, binary = json.loads(data[20 : 20 + size]), data[28 + size :]

    def points(index: int) -> np.ndarray:
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        begin = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return np.frombuffer(binary, "<f4", 3 * accessor["count"], begin).reshape(-1, 3).astype(float)

    found = []
    for mesh in document["meshes"]:
        (primitive,) = mesh["primitives"]
        base = points(primitive["attributes"]["POSITION"])
        found.append(base)
        found += [base + points(target["POSITION"]) for target in primitive.get("targets", ())]
    return found


def both(run: Path, folder: Path, *words: str) -> list[np.ndarray]:
    """Return the days of the PC2, which are the MDD's too."""
    wizen("export", str(run), "--out", str(folder / "a.pc2"), *words)
    wizen("export", str(run), "--out", str(folder / "a.mdd"), *words)
    frames, others = pc2((folder / "a.pc2").read_bytes()), mdd((folder / "a.mdd").read_bytes())
    assert np.array_equal(frames, others)
    return frames


def test_caches_hold_each_vertex_of_each_day(run: Path, tmp_path: Path) -> None:
    frames = both(run, tmp_path, "--fps", "24", "--step", "12")
    here = stored(run, "position")
    count = here[0].size // 3
    wizen("export", str(run), "--out", str(tmp_path / "a.glb"))
    for frame, wanted, shown in zip(frames, here, targets(tmp_path / "a.glb"), strict=True):
        assert np.array_equal(frame[:count], wanted.reshape(-1, 3).astype("<f4"))
        # the two poles, which the lattice leaves out, lie within the rings about them
        for pole, ring in zip(frame[count:], (wanted[0], wanted[-1]), strict=True):
            assert np.linalg.norm(pole - ring.mean(axis=0)) < np.ptp(ring, axis=0).max() / 2
        # a GLB has copies along its seam: each of its points is one of the cache's, and each of these is there
        for some, others in ((frame, shown), (shown, frame)):
            assert KDTree(others).query(some)[0].max() < 2e-6
    # the time of each day: every half second, to the last digit
    data = (tmp_path / "a.mdd").read_bytes()
    assert struct.unpack(">3f", data[8:20]) == (0.0, 0.5, 1.0)
    assert struct.unpack("<ff", (tmp_path / "a.pc2").read_bytes()[20:28]) == (1.0, 12.0)


def test_caches_move_a_mesh_of_ones_own_in_its_own_order(tmp_path: Path) -> None:
    """Whoever has the OBJ needs its order: a ring, whose points the file names in an order of its own."""
    ring = trimesh.creation.torus(0.7, 0.3, major_sections=24, minor_sections=12)
    order = np.random.default_rng(7).permutation(len(ring.vertices))
    points, faces = ring.vertices[np.argsort(order)], order[ring.faces]
    text = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (tmp_path / "ring.obj").write_text("\n".join(text))
    run = tmp_path / "ring.h5"
    words = f"--preset apple --quality preview --stages 0,6 --set body=quasi-static --set mesh=@{tmp_path}/ring.obj"
    wizen("solve", "decay", *words.split(), "--set", 'wounds=[{"vertex":5}]', "--out", str(run))
    frames = both(run, tmp_path)
    assert np.array_equal(frames, stored(run, "mesh_position").astype("<f4"))
    # the first day sags by its weight alone, and points that were neighbours in the file still are
    assert np.linalg.norm(frames[0] - points, axis=1).max() < 0.05
    assert motion(frames) > 0.02
