"""Jobs over HTTP, run by real worker processes with a cheap real solver from outside the package."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import trimesh
import xarray as xr
from openapi_spec_validator import validate

from service.app import create_app
from service.settings import Settings
from solver import registry
from solver.contract import Need
from solver.meshes import frame
from store.queue import Queue
from store.store import Store
from store.tokens import Tokens
from sweeps import executors
from sweeps.runner import run_queue

from .conftest import client_of, served
from .test_problems import checked
from .test_sequences import accessor, parsed

ROOT = Path(__file__).resolve().parents[2]
SWEEPS = ROOT / "tests" / "sweeps"


@pytest.fixture(scope="module", autouse=True)
def _shrinking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the solver `shrinking` the way any third one is, here and in the workers."""
    info = tmp_path_factory.mktemp("site") / "shrinking-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: shrinking\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[wizen.solvers]\nshrinking = shrinking:SOLVER\n")
    paths = [str(SWEEPS), str(info.parent), str(ROOT)]
    with pytest.MonkeyPatch.context() as patch:
        for path in paths[:2]:
            patch.syspath_prepend(path)
        patch.setenv("PYTHONPATH", os.pathsep.join(paths))
        for found in (registry._places, registry.get):
            found.cache_clear()
        yield
    for found in (registry._places, registry.get):
        found.cache_clear()


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with a line per solve, in whichever process."""
    monkeypatch.setenv("SHRINKING_LOG", str(tmp_path / "solves.log"))
    return tmp_path / "solves.log"


@pytest.fixture
def store(tmp_path: Path, log: Path) -> Store:
    return Store.open(tmp_path / "store", create=True)


def bearer(store: Store, name: str = "tester", scope: Any = "run") -> dict[str, str]:
    return {"Authorization": f"Bearer {Tokens(store.root).create(name, [scope])[1]}"}


@pytest.fixture
def queue_only(store: Store) -> Iterator[httpx.Client]:
    """A service that leaves its jobs to others, asked by somebody who may."""
    with client_of(store.root, jobs_workers=0, max_jobs=4, max_jobs_per_token=3) as client:
        client.headers.update(bearer(store))
        yield client


def body(te: float = 0.04, stages: tuple[float, ...] = (0.1, 0.2), **params: Any) -> dict[str, Any]:
    need = {"stages": stages, "quality": "preview"}
    return {"solver": "shrinking", "preset": "sphere", "params": {"te": te, **params}, "need": need}


def drain(store: Store) -> int:
    with executors.serial() as workers:
        return run_queue(store, workers, threading.Event(), patience=0)


def until(happened: Callable[[], bool], seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


def events(client: httpx.Client, url: str, last: str = "") -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    with client.stream("GET", url, headers={"Last-Event-ID": last} if last else {}) as answer:
        if answer.status_code == 204:
            return found
        assert answer.headers["content-type"].startswith("text/event-stream")
        entry: dict[str, Any] = {}
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if name in ("id", "event"):
                entry[name] = value
            elif name == "data":
                found.append({**entry, "job": json.loads(value)})
    return found


def test_a_job_runs_beside_the_service_and_its_events_tell(store: Store) -> None:
    with client_of(store.root) as client:
        client.headers.update(bearer(store))
        asked = client.post("/v1/jobs", json=body(pause=1.0))
        assert asked.status_code == 202
        url = asked.headers["location"]
        assert asked.json()["links"]["self"] == url
        assert asked.json()["expected"] == {"seconds": 0.01, "bytes": 1000}
        told = events(client, f"{url}/events")
        assert [e["job"]["state"] for e in told][-1] == "done"
        assert {e["job"]["state"] for e in told} >= {"running", "done"}
        running = [e["job"]["progress"] for e in told if e["event"] == "progress"]
        assert {"fraction": 0.5, "message": "stage 0"} in running
        fractions = [e["job"]["progress"]["fraction"] for e in told]
        assert fractions == sorted(fractions)
        # one that comes back goes on where it was, and one that has seen the end need not come back
        again = events(client, f"{url}/events", told[-2]["id"])
        assert [e["id"] for e in again] == [told[-1]["id"]]
        assert events(client, f"{url}/events", told[-1]["id"]) == []
        # the same question is the same job
        same = client.post("/v1/jobs", json=body(pause=1.0))
        assert (same.status_code, same.headers["location"], same.json()["state"]) == (200, url, "done")
        assert same.json()["seconds"] > 2
        answer = client.get(same.json()["links"]["result"])
        assert answer.headers["content-type"] == "application/x-netcdf"
        assert answer.content[:8] == b"\x89HDF\r\n\x1a\n"


def test_results_by_accept(store: Store, queue_only: httpx.Client, tmp_path: Path) -> None:
    job = queue_only.post("/v1/jobs", json=body()).json()
    result = f"{job['links']['self']}/result"
    waiting = checked(queue_only.get(result), 409, "job-not-done")
    assert "events" in waiting["advice"]
    assert drain(store) == 1
    whole = queue_only.get(result)
    (tmp_path / "run.h5").write_bytes(whole.content)
    with xr.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as run:
        assert list(run["stage"]) == [0.1, 0.2]
    tag = {"If-None-Match": whole.headers["etag"]}
    assert queue_only.get(result, headers=tag).status_code == 304
    mesh = queue_only.get(result, params={"stage": 0.1}, headers={"Accept": "model/obj"})
    assert mesh.headers["content-type"] == "model/obj"
    assert mesh.headers["etag"] != whole.headers["etag"]
    (tmp_path / "shape.obj").write_bytes(mesh.content)
    points = trimesh.load(tmp_path / "shape.obj").vertices
    assert np.allclose(np.linalg.norm(points, axis=1), (1 - 0.1) * 1.04, rtol=1e-5)
    said = queue_only.get(result, params={"format": "json"}).json()
    assert said["stage"]["value"] == 0.2
    assert said["digest"] in whole.headers["etag"]
    assert (
        "0.1, 0.2"
        in checked(queue_only.get(result, params={"stage": 0.15, "format": "glb"}), 422, "invalid-query")["advice"]
    )
    checked(queue_only.get(result, headers={"Accept": "text/html"}), 406, "not-acceptable")
    checked(queue_only.get(result, params={"format": "doc"}), 422, "invalid-query")
    part = {**body(), "need": {"stages": [0.1], "fields": ["volume"]}}
    numbers = queue_only.post("/v1/jobs", json=part).json()["links"]["self"]
    drain(store)
    checked(queue_only.get(f"{numbers}/result?format=glb"), 406, "not-acceptable")
    assert queue_only.get(f"{numbers}/result").status_code == 200
    # a shard that is gone is computed again when asked for, and a damaged one is not passed on
    store.shard_path(job["id"]).write_bytes(whole.content[:-1])
    checked(queue_only.get(result), 503, "corrupt-shard")
    store.shard_path(job["id"]).unlink()
    checked(queue_only.get(result), 404, "unknown-job")
    assert queue_only.post("/v1/jobs", json=body()).status_code == 202
    assert drain(store) == 1
    assert queue_only.get(result).status_code == 200


def test_breaking_wood_comes_back_as_meshes(store: Store, queue_only: httpx.Client, tmp_path: Path) -> None:
    params = {"rods": 8, "vertices": 8, "length": 0.05, "radius": 0.003, "clamp": "both", "pull": [20.0, 0.0, 0.0]}
    need = {"stages": [0.0, 6e-5], "fields": ["mesh_position", "inside", "broken_rods"]}
    asked = queue_only.post("/v1/jobs", json={"solver": "wood", "params": params, "need": need})
    assert asked.status_code == 202
    assert drain(store) == 1
    result = f"{asked.json()['links']['self']}/result"
    (tmp_path / "run.h5").write_bytes(queue_only.get(result).content)
    with xr.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as run:
        assert run["broken_rods"].values[1] > 0
        assert run["face_count"].values[1] > run["face_count"].values[0]
    (tmp_path / "one.glb").write_bytes(queue_only.get(result, params={"format": "glb", "stage": 0.0}).content)
    whole: Any = trimesh.load(tmp_path / "one.glb", force="mesh")
    # corners have a vertex per colour and normal; in space they are one
    solid = trimesh.Trimesh(whole.vertices, whole.faces)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(np.pi * 0.003**2 * 0.05, rel=1e-4)
    # bark is dark, ends are light
    document, binary = parsed((tmp_path / "one.glb").read_bytes())
    colour = accessor(document, binary, document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    assert np.ptp(colour[:, 0]) > 0.05
    moving = queue_only.get(result, params={"format": "animation"})
    assert moving.headers["content-type"] == "model/gltf-binary"
    (tmp_path / "all.glb").write_bytes(moving.content)
    scene: Any = trimesh.load(tmp_path / "all.glb")
    assert len(scene.geometry) == 2


#: Per solver: small parameters, cheap stages, and fields worth their numbers besides those of one number per stage.
FOUR: dict[str, tuple[dict[str, Any], list[float], list[str]]] = {
    "dehydration": ({"te": 0.1, "gamma": 3.0}, [0.01, 0.02], ["displacement", "volume"]),
    "decay": ({"growth": 50.0}, [0.3, 0.6], ["position", "volume"]),
    "growth": ({"step": 0.2, "thickness": 0.1}, [0.1, 0.25], ["mesh_position", "mesh_area"]),
    "wood": ({"rods": 8, "vertices": 16, "bend": 0.01, "length": 0.15}, [2e-4, 4e-4], ["mesh_position"]),
}


@pytest.mark.parametrize("solver", FOUR)
def test_every_solver_s_job_comes_back_as_glb_and_as_fields(
    store: Store, queue_only: httpx.Client, tmp_path: Path, solver: str
) -> None:
    params, stages, wanted = FOUR[solver]
    known = registry.get(solver).fields
    fields = [name for name in wanted if name in known]
    assert len(fields) == len(wanted), sorted(known)
    need = {"stages": stages, "quality": "preview", "resolution": 16}
    need["fields"] = sorted({*registry.get(solver).default_fields, *fields})
    asked = queue_only.post("/v1/jobs", json={"solver": solver, "params": params, "need": need})
    assert asked.status_code == 202, asked.text
    assert drain(store) == 1
    result = f"{asked.json()['links']['self']}/result"
    (tmp_path / "one.glb").write_bytes(queue_only.get(result, params={"format": "glb", "stage": stages[0]}).content)
    mesh: Any = trimesh.load(tmp_path / "one.glb", force="mesh")
    assert len(mesh.faces) > 100
    assert np.isfinite(mesh.vertices).all()
    assert np.ptp(mesh.vertices, axis=0).min() > 0
    run = store.get(asked.json()["id"])
    said = queue_only.get(result, params={"format": "json", "fields": ",".join(["stage", "converged", *fields])})
    assert said.headers["content-type"] == "application/json"
    found = said.json()
    assert (found["solver"], list(found["fields"])) == (solver, ["stage", "converged", *fields])
    for name, field in found["fields"].items():
        assert (field["dims"], field["units"]) == (list(run[name].dims), run[name].attrs.get("units", "1"))
        assert np.array_equal(np.asarray(field["values"], run[name].dtype), run[name].values)
    last = queue_only.get(result, params={"format": "json", "fields": fields[0], "stage": stages[-1]}).json()
    values = np.asarray(last["fields"][fields[0]]["values"], run[fields[0]].dtype)
    own = frame(run, -1).vertices if fields[0] == "mesh_position" else run[fields[0]].values[-1]
    assert np.array_equal(values.reshape(own.shape), own)
    checked(queue_only.get(result, params={"format": "json", "fields": "beauty"}), 422, "invalid-query")
    checked(queue_only.get(result, params={"format": "json", "fields": "stage", "stage": 77}), 422, "invalid-query")


def test_a_peach_that_dries_by_the_table_comes_back_as_glb(store: Store, queue_only: httpx.Client) -> None:
    params = {"body": "table", "growth_rate": 60.0}
    need = {"stages": [0.0, 2.0], "quality": "preview", "resolution": 32, "fields": ["position", "rot", "mould"]}
    order = {"solver": "decay", "preset": "peach", "params": params, "need": need}
    asked = queue_only.post("/v1/jobs", json=order)
    assert asked.status_code == 202, asked.text
    assert drain(store) == 1
    result = f"{asked.json()['links']['self']}/result"
    solids, colours = [], []
    for day in need["stages"]:
        answer = queue_only.get(result, params={"format": "glb", "stage": day})
        assert answer.headers["content-type"] == "model/gltf-binary"
        mesh: Any = trimesh.load(io.BytesIO(answer.content), file_type="glb", force="mesh")
        assert np.isfinite(mesh.vertices).all()
        # poles and seam have a vertex per colour and normal; in space they are one
        solids.append(trimesh.Trimesh(mesh.vertices, mesh.faces))
        document, binary = parsed(answer.content)
        colours.append(accessor(document, binary, document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]))
    assert all(solid.is_watertight for solid in solids)
    # the shape is the table's, at the shrinkage that the water lost by Eq. 10 leaves
    peach = registry.get("decay").parse(params, "peach")
    lost = registry.get("decay").solve(peach, Need(fields=("water_lost",), stages=(2.0,))).water_lost.values[0]
    assert solids[0].volume == pytest.approx(4 / 3 * np.pi * 1.04**3, rel=5e-3)
    fresh_less_water = solids[0].volume * (1 - lost)
    assert solids[1].volume == pytest.approx(fresh_less_water, rel=0.1)
    # mould spreads over what was fresh skin
    assert np.mean(np.abs(colours[1] - colours[0]).max(axis=1) > 0.1) > 0.05
    # what the table does not hold is a typed error, with what to change
    wrong = {**order, "preset": "orange"}
    missing = queue_only.post("/v1/jobs", json=wrong)
    assert missing.status_code == 202
    drain(store)
    end = queue_only.get(missing.headers["location"]).json()
    assert end["state"] == "failed"
    assert "table" in json.dumps(end)


@pytest.mark.parametrize(
    ("change", "status", "code"),
    [
        ({"solver": "shrinkin"}, 404, "unknown-solver"),
        ({"preset": "spheer"}, 422, "invalid-input"),
        ({"params": {"te": -1}}, 422, "invalid-input"),
        ({"params": {"stone": [1.5, 0.4]}}, 422, "invalid-geometry"),
        ({"params": {"tea": 0.1}}, 422, "invalid-input"),
        ({"need": {"stages": [7]}}, 422, "invalid-input"),
        ({"need": {"fields": ["colour"]}}, 422, "invalid-input"),
        ({"need": {"quality": "superb"}}, 422, "invalid-query"),
        ({"extra": 1}, 422, "invalid-query"),
        ({"solver": "\ud800"}, 404, "unknown-solver"),
        ({"params": []}, 422, "invalid-query"),
        ({"need": {"resolution": 1024, "stages": [i / 1000 for i in range(200)]}}, 422, "too-costly"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(
    queue_only: httpx.Client, store: Store, change: dict[str, Any], status: int, code: str
) -> None:
    answer = queue_only.post(
        "/v1/jobs", content=json.dumps({**body(), **change}), headers={"content-type": "application/json"}
    )
    problem = checked(answer, status, code)
    assert problem["detail"]
    assert Queue(store.ledger).waiting() == []


def test_a_failure_comes_with_advice_and_may_be_tried_again(store: Store, queue_only: httpx.Client, log: Path) -> None:
    job = queue_only.post("/v1/jobs", json=body(trouble="diverges")).json()
    drain(store)
    failed = queue_only.get(job["links"]["self"]).json()
    assert failed["state"] == "failed"
    assert failed["problem"]["type"] == "urn:wizen:problem:not-converged"
    assert (failed["problem"]["advice"], failed["problem"]["last_stage"]) == ("Take care.", 0.1)
    problem = checked(queue_only.get(f"{job['links']['self']}/result"), 409, "job-failed")
    assert "it diverged" in problem["detail"]
    assert queue_only.post("/v1/jobs", json=body(trouble="diverges")).status_code == 200
    assert drain(store) == 0
    again = queue_only.post("/v1/jobs", json={**body(trouble="diverges"), "again": True})
    assert (again.status_code, again.json()["state"]) == (202, "wanted")
    checked(queue_only.get(f"{job['links']['self']}/result"), 409, "job-not-done")
    crashed = queue_only.post("/v1/jobs", json=body(trouble="crashes")).json()
    drain(store)
    assert "Traceback" not in queue_only.get(crashed["links"]["self"]).text


def test_pages_and_states(store: Store, queue_only: httpx.Client) -> None:
    ids = [queue_only.post("/v1/jobs", json=body(te)).json()["id"] for te in (0.02, 0.03, 0.04)]
    first = queue_only.get("/v1/jobs?limit=2").json()
    second = queue_only.get(first["next"]).json()
    assert [job["id"] for job in first["jobs"] + second["jobs"]] == ids[::-1]
    assert second["next"] is None
    drain(store)
    assert len(queue_only.get("/v1/jobs?state=done").json()["jobs"]) == 3
    assert queue_only.get("/v1/jobs?state=wanted").json()["jobs"] == []
    checked(queue_only.get("/v1/jobs?state=lost"), 422, "invalid-query")
    checked(queue_only.get(f"/v1/jobs/{'0' * 64}"), 404, "unknown-job")
    checked(queue_only.get("/v1/jobs/nonsense"), 404, "unknown-job")


def test_quotas(store: Store, queue_only: httpx.Client) -> None:
    for te in (0.02, 0.03, 0.04):
        assert queue_only.post("/v1/jobs", json=body(te)).status_code == 202
    full = queue_only.post("/v1/jobs", json=body(0.05))
    assert "3 of your jobs" in checked(full, 429, "queue-full")["detail"]
    assert full.headers["retry-after"]
    # what is asked for already may be asked for again
    assert queue_only.post("/v1/jobs", json=body(0.04)).status_code == 202
    other = bearer(store, "other")
    assert queue_only.post("/v1/jobs", json=body(0.05), headers=other).status_code == 202
    assert "4 jobs" in checked(queue_only.post("/v1/jobs", json=body(0.06), headers=other), 429, "queue-full")["detail"]
    admin = bearer(store, "admin", "admin")
    assert queue_only.post("/v1/jobs", json=body(0.06), headers=admin).status_code == 202


def test_cancelling_stops_for_its_asker_alone(store: Store, queue_only: httpx.Client) -> None:
    other, admin = bearer(store, "other"), bearer(store, "admin", "admin")
    url = queue_only.post("/v1/jobs", json=body()).headers["location"]
    queue_only.post("/v1/jobs", json=body(), headers=other)
    assert queue_only.delete(url).json()["state"] == "wanted"
    checked(queue_only.delete(url), 403, "forbidden")
    assert queue_only.delete(url, headers=other).json()["state"] == "cancelled"
    assert queue_only.delete(url).json()["state"] == "cancelled"
    assert drain(store) == 0
    assert queue_only.post("/v1/jobs", json=body()).json()["state"] == "wanted"
    assert queue_only.delete(url, headers=admin).json()["state"] == "cancelled"
    queue_only.post("/v1/jobs", json=body())
    drain(store)
    checked(queue_only.delete(url), 409, "job-ended")
    checked(queue_only.delete(f"/v1/jobs/{'0' * 64}"), 404, "unknown-job")


def test_a_running_job_stops_when_cancelled(store: Store) -> None:
    with client_of(store.root) as client:
        client.headers.update(bearer(store))
        url = client.post("/v1/jobs", json=body(pause=60)).headers["location"]
        until(lambda: client.get(url).json()["state"] == "running")
        assert client.delete(url).json()["state"] == "cancelled"
        # its worker is free for the next one
        after = client.post("/v1/jobs", json=body(0.03)).headers["location"]
        assert [e["job"]["state"] for e in events(client, f"{after}/events")][-1] == "done"
        assert client.get(url).json()["state"] == "cancelled"


def serve(store: Store) -> tuple[subprocess.Popen[str], str]:
    environment = {**os.environ, "WIZEN_JOBS_WORKERS": "2"}
    command = [sys.executable, "-m", "service.cli", "serve", "--store", str(store.root), "--port", "0"]
    running = subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)
    assert running.stderr is not None
    address = running.stderr.readline().split()[-1]
    assert address.startswith("http://"), address
    return running, address


def test_a_killed_service_loses_no_job(store: Store, log: Path) -> None:
    """Kill -9 with ten jobs queued, some of them running; the next service finishes all ten."""
    headers = bearer(store)
    first, address = serve(store)
    with httpx.Client(base_url=address, headers=headers, timeout=20) as client:
        until(lambda: _answers(client))
        asked = [client.post("/v1/jobs", json=body(0.02 + 0.002 * i, pause=0.3)) for i in range(10)]
    assert {answer.status_code for answer in asked} == {202}
    until(lambda: store.ledger.counts()["done"] >= 2 and store.ledger.counts()["running"] > 0)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    before = store.ledger.counts()["done"]
    assert 2 <= before < 10
    second, address = serve(store)
    try:
        with httpx.Client(base_url=address, timeout=20) as client:
            until(lambda: _answers(client))
            until(lambda: len(client.get("/v1/jobs?state=done").json()["jobs"]) == 10)
            for answer in asked:
                assert client.get(f"{answer.headers['location']}/result").status_code == 200
    finally:
        second.send_signal(signal.SIGTERM)
        second.communicate(timeout=30)
    # the kill interrupted at most one solve per worker
    assert 10 <= len(log.read_text().splitlines()) <= 12


def _answers(client: httpx.Client) -> bool:
    try:
        return client.get("/").status_code == 200
    except httpx.TransportError:
        return False


def test_two_services_run_no_job_twice(store: Store, log: Path) -> None:
    apps = [create_app(Settings(store=store.root)) for _ in range(2)]
    headers = bearer(store)
    with served(apps[0]) as one, served(apps[1]) as two:
        asked = [c.post("/v1/jobs", json=body(0.02 + 0.01 * i), headers=headers) for i in range(3) for c in (one, two)]
        assert len({answer.json()["id"] for answer in asked}) == 3
        until(lambda: len(two.get("/v1/jobs?state=done").json()["jobs"]) == 3)
    assert len(log.read_text().splitlines()) == 3


def test_jobs_of_stopped_sweeps_are_left_alone(store: Store, queue_only: httpx.Client) -> None:
    asked = queue_only.post("/v1/jobs", json=body()).json()
    (job,) = store.ledger.jobs()
    other = type(job)(**{**vars(job), "key": "0" * 64})
    store.ledger.want([other], "some plan")
    assert drain(store) == 1
    assert store.ledger.get(asked["id"]).state == "done"
    assert store.ledger.get(other.key).state == "wanted"


def test_the_page_shows_every_solver_s_own_model(queue_only: httpx.Client) -> None:
    document = queue_only.get("/openapi.json").json()
    validate(document)
    schemas = document["components"]["schemas"]
    assert set(schemas["JobRequest"]["discriminator"]["mapping"]) == {
        "decay",
        "dehydration",
        "growth",
        "shrinking",
        "wood",
    }
    form = schemas["JobRequest_dehydration"]["properties"]
    assert form["params"]["properties"]["modulus_ratio"]["maximum"] == 1000
    assert form["params"]["properties"]["gamma"]["maximum"] == 1000
    assert form["params"]["additionalProperties"] is False
    assert form["need"]["properties"]["stages"]["items"]["maximum"] == 0.6
    post, get = document["paths"]["/v1/jobs"]["post"], document["paths"]["/v1/jobs"]["get"]
    assert post["security"] == [{"token": []}]
    assert "security" not in get
    assert document["components"]["securitySchemes"]["token"]["scheme"] == "bearer"


def test_the_starter_takes_no_jobs() -> None:
    from store.starter import ROOT as STARTER

    before = sorted(STARTER.rglob("*"))
    with client_of(STARTER) as client:
        assert client.get("/v1/jobs").json() == {"jobs": [], "next": None}
        checked(client.post("/v1/jobs", json=body()), 401, "unauthorized")
    assert sorted(STARTER.rglob("*")) == before
