"""`wizen export`, and the same formats over HTTP."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from service.cli import app
from solver import registry
from solver.contract import Need
from store import shards
from store.store import Store
from sweeps.planning.plan import job

from ._asking import checked
from ._runs import shrinking, splitting
from .conftest import client_of


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, str]:
    """A store with one finished job of decay."""
    store = Store.open(tmp_path_factory.mktemp("export") / "store", create=True)
    solver = registry.get("decay")
    params = solver.parse({}, "orange")
    need = solver.settle(Need(quality="preview", resolution=12, stages=(0.0, 0.1), fields=("rot", "mould")))
    spec = job(solver, params, need)
    store.ledger.want([spec], "test")
    claimed = store.ledger.claim("tester", 60)
    assert claimed is not None
    store.ledger.done(claimed, store.put(spec.key, solver.solve(params, need)), 0.1)
    return store, spec.key


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["export", *words])
    return done.exit_code, done.output


def test_threads_where_no_mould_grows_are_said_to_add_nothing(stored: tuple[Store, str], tmp_path: Path) -> None:
    solver = registry.get("growth")
    params, need = solver.parse({"step": 0.2, "thickness": 0.1}), solver.settle(Need(quality="preview", stages=(0.1,)))
    path, out = tmp_path / "run.h5", str(tmp_path / "a.glb")
    shards.write(path, solver.solve(params, need), job(solver, params, need).key)
    said = "no mould grows on results of growth: --threads adds nothing"
    assert said in run(str(path), "--out", out, "--threads", "100")[1]
    assert said not in run(str(path), "--out", out)[1]
    store, key = stored
    assert "no mould" not in run(key[:10], "--store", str(store.root), "--out", out, "--threads", "100")[1]


def test_the_command_line_writes_by_key_and_by_file(stored: tuple[Store, str], tmp_path: Path) -> None:
    store, key = stored
    code, said = run(key[:10], "--store", str(store.root), "--out", str(tmp_path / "a.ply.zip"), "--json")
    assert code == 0, said
    document = json.loads(said)
    assert (document["format"], document["stages"], document["vertices"]) == ("ply-zip", [0.0, 0.1], 2 * 290)
    assert len(zipfile.ZipFile(tmp_path / "a.ply.zip").namelist()) == 3
    path = tmp_path / "run.h5"
    shards.write(path, store.get(key), key)
    code, said = run(str(path), "--out", str(tmp_path / "rot.png"), "--size", "16")
    assert code == 0, said
    assert (tmp_path / "rot.png").read_bytes()[:4] == b"\x89PNG"


def test_a_format_goes_by_the_name_of_its_suffix_too(
    stored: tuple[Store, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, key = stored
    monkeypatch.chdir(tmp_path)
    for name in ("glb", "animation"):
        code, said = run(key, "--store", str(store.root), "--format", name, "--json")
        assert code == 0, said
        document = json.loads(said)
        assert (document["format"], document["path"]) == ("animation", f"{key}.glb")
    code, said = run(key, "--store", str(store.root), "--format", "usdc", "--out", "scene.usd", "--json")
    assert code == 0, said
    assert (tmp_path / "scene.usd").read_bytes()[:8] == b"PXR-USDC"


def test_a_mesh_of_one_s_own_gets_its_cache(stored: tuple[Store, str], tmp_path: Path) -> None:
    store, key = stored
    ball = trimesh.creation.icosphere(3, radius=4)
    ball.export(tmp_path / "my.stl")
    words = [key, "--store", str(store.root), "--mesh", str(tmp_path / "my.stl")]
    code, said = run(*words, "--out", str(tmp_path / "my.pc2"), "--json")
    assert code == 0, said
    assert json.loads(said)["length"] == "the unit of my.stl"
    points = np.frombuffer((tmp_path / "my.pc2").read_bytes(), "<f4", offset=32).reshape(2, -1, 3)
    assert np.allclose(np.linalg.norm(points, axis=2), 4, atol=1e-5)  # this fruit does not move
    code, _ = run(*words, "--out", str(tmp_path / "my.glb"))
    assert code == 2


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["nothing.h5", "--out", "a.glb"], "no file"),
        (["abc", "--out", "a.glb"], "--store"),
        (["{file}", "--out", "a.doc"], "Formats"),
        (["{file}"], "--format"),
        (["{file}", "--out", "a.pc2"], "stay"),
        (["{file}", "--out", "a.glb", "--format", "usdc"], "named as animation"),
        (["{file}", "--out", "a.obj", "--format", "ply"], "named as obj"),
        (["{file}", "--out", "a.glb", "--stage", "3"], "no stage"),
    ],
)
def test_what_cannot_be_written_is_said(
    words: list[str], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shards.write(tmp_path / "run.h5", splitting(), "0" * 64)
    code, said = run(*(word.format(file="run.h5") for word in words))
    assert code == 2
    assert why in said
    assert not list(tmp_path.glob("a.*"))


def test_the_service_sends_the_same_formats(stored: tuple[Store, str]) -> None:
    store, key = stored
    with client_of(store.root, jobs_workers=0, max_map=64) as client:
        url = f"/v1/jobs/{key}/result"
        for accept, start, said in (
            ("application/x-pc2", b"POINTCACHE2\0", {}),
            ("model/vnd.usdc", b"PXR-USDC", {}),
            ("image/png", b"\x89PNG", {"size": 16}),
            ("image/x-exr", b"\x76\x2f\x31\x01", {"size": 16}),
            ("model/x-ply", b"ply\n", {}),
        ):
            answer = client.get(url, params=said, headers={"Accept": accept})
            assert answer.content[: len(start)] == start
            assert answer.headers["content-type"] == accept
        film = client.get(url, headers={"Accept": "model/gltf-binary; stages=all"})
        assert film.headers["content-type"] == "model/gltf-binary"
        assert len(trimesh.load(io.BytesIO(film.content), file_type="glb").geometry) == 2
        still = client.get(url, headers={"Accept": "model/gltf-binary"})
        assert len(trimesh.load(io.BytesIO(still.content), file_type="glb").geometry) == 1
        assert b"COLOR_0" in still.content
        other = client.get(url, params={"format": "png", "size": 16, "map": "mould"})
        assert other.headers["etag"] != client.get(url, params={"format": "png", "size": 16}).headers["etag"]
        assert client.get(other.url, headers={"If-None-Match": other.headers["etag"]}).status_code == 304
        checked(client.get(url, params={"format": "png", "size": 65}), 422, "invalid-query")
        checked(client.get(url, params={"format": "png", "map": "moss"}), 422, "invalid-query")
        checked(client.get(url, params={"format": "usdc", "fps": 0}), 422, "invalid-query")
        problem = checked(client.get(url, headers={"Accept": "model/fbx"}), 406, "not-acceptable")
        assert "format=pc2" in problem["advice"]
        assert "usdc" in client.get("/").json()["result_formats"]


def test_the_service_says_what_a_changing_mesh_cannot_be(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    solver = registry.get("decay")
    need = solver.settle(Need(stages=(0.0,)))
    spec = job(solver, solver.parse({}), need)
    store.ledger.want([spec], "test")
    claimed = store.ledger.claim("tester", 60)
    assert claimed is not None
    store.ledger.done(claimed, store.put(spec.key, splitting()), 0.1)
    with client_of(store.root, jobs_workers=0, max_export_samples=200) as client:
        url = f"/v1/jobs/{spec.key}/result"
        large = checked(client.get(url, params={"format": "animation"}), 422, "invalid-query")
        assert "wizen export" in large["advice"]
        still = client.get(url, params={"format": "obj", "stage": 0})
        assert len(trimesh.load(io.BytesIO(still.content), file_type="obj").faces) == 12
    with client_of(store.root, jobs_workers=0) as client:
        problem = checked(client.get(url, params={"format": "pc2"}), 422, "unfit-format")
        assert "usdc" in problem["advice"]


@pytest.mark.parametrize("stage", ["nan", "inf", "-inf", "1e308"])
def test_what_is_no_stage_is_not_the_nearest_one(stored: tuple[Store, str], tmp_path: Path, stage: str) -> None:
    """No distance of nan, and none from infinity over its size, is more than a tolerance."""
    store, key = stored
    out = tmp_path / "a.glb"
    code, said = run(key[:10], "--store", str(store.root), "--out", str(out), f"--stage={stage}")
    assert code == 2, said
    assert "has no stage" in said
    assert not out.exists()


def test_a_file_that_is_no_result_is_not_said_to_be_no_file(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(b"glTF")
    code, said = run(str(tmp_path / "a.glb"), "--out", str(tmp_path / "a.obj"))
    assert code == 2
    assert "holds no result: result files are .h5" in " ".join(said.split())


def test_a_stage_that_is_advised_is_found(tmp_path: Path) -> None:
    path, out = tmp_path / "run.h5", str(tmp_path / "a.obj")
    shards.write(path, shrinking().assign_coords(stage=[0.1, 0.10000001, 0.2]), "0" * 64)
    code, said = run(str(path), "--out", out, "--stage", "0.15")
    assert code == 2
    advised = " ".join(said.split()).partition("Take one of ")[2].rstrip(".").split(", ")
    assert advised == ["0.1", "0.10000001", "0.2"]
    code, said = run(str(path), "--out", out, "--stage", advised[1], "--json")
    assert (code, json.loads(said)["stages"]) == (0, [0.10000001])
