"""Jobs over HTTP, run by real worker processes with a cheap real solver from outside the package."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
from openapi_spec_validator import validate

from service.app import create_app
from service.jobs import views
from service.settings import Settings
from solver import registry
from solver.contract import Need
from store import starter
from store.ledger.jobs import JobSpec
from store.ledger.queue import Queue
from store.store import Store

from ..store.conftest import fill
from ._asking import ROOT, answers, checked, until
from ._jobs import bearer, body, drain, events
from .conftest import client_of, served

pytestmark = pytest.mark.usefixtures("shrinking")


def test_a_job_runs_beside_the_service_and_its_events_tell(store: Store, log: Path) -> None:
    halfway = {"fraction": 0.5, "message": "stage 0"}
    hold(log, 0)

    def go_on(event: dict[str, Any]) -> None:
        if event["job"]["progress"] == halfway:
            let_go(log)

    asking = body(pause=0.1, trouble="waits")
    with client_of(store.root) as client:
        client.headers.update(bearer(store))
        asked = client.post("/v1/jobs", json=asking)
        assert asked.status_code == 202
        url = asked.headers["location"]
        assert asked.json()["links"]["self"] == url
        assert asked.json()["expected"] == {"seconds": 0.01, "bytes": 1000}
        told = events(client, f"{url}/events", then=go_on)
        assert [e["job"]["state"] for e in told][-1] == "done"
        assert {e["job"]["state"] for e in told} >= {"running", "done"}
        running = [e["job"]["progress"] for e in told if e["event"] == "progress"]
        assert halfway in running
        fractions = [e["job"]["progress"]["fraction"] for e in told]
        assert fractions == sorted(fractions)
        # one that comes back goes on where it was, and one that has seen the end need not come back
        again = events(client, f"{url}/events", told[-2]["id"])
        assert [e["id"] for e in again] == [told[-1]["id"]]
        assert events(client, f"{url}/events", told[-1]["id"]) == []
        # the same question is the same job
        same = client.post("/v1/jobs", json=asking)
        assert (same.status_code, same.headers["location"], same.json()["state"]) == (200, url, "done")
        assert same.json()["seconds"] > 0.2
        answer = client.get(same.json()["links"]["result"])
        assert answer.headers["content-type"] == "application/x-netcdf"
        assert answer.content[:8] == b"\x89HDF\r\n\x1a\n"


_WITHIN = {"shape": "disc", "solids": [{"kind": "ball", "radius": 2}]}


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
        # a disc in the middle of a ball
        ({"solver": "growth", "preset": None, "params": _WITHIN, "need": {"stages": [0.1]}}, 422, "invalid-geometry"),
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


def test_what_stands_beside_need_and_params_is_told_its_place(queue_only: httpx.Client) -> None:
    answer = queue_only.post("/v1/jobs", json={"solver": "dehydration", "stages": [0.1], "te": 0.04, "gamma": 10})
    told = checked(answer, 422, "invalid-query")
    assert told["detail"] == "gamma: belongs into params; stages: belongs into need; te: belongs into params."
    assert '{"need": {"stages": ...}}' in told["advice"]
    said = {"solver": "dehydration", "params": {"te": 0.1, "mirrors": "xyz"}, "need": {"stages": [0.1]}}
    assert queue_only.post("/v1/jobs", json=said).status_code == 202  # as it advises


def test_a_run_that_starts_from_a_result_that_is_not_there_is_refused(queue_only: httpx.Client, store: Store) -> None:
    need = {"stages": [0.1], "quality": "preview"}

    def ask(key: str) -> httpx.Response:
        params = {"pattern": {"key": key, "stage": 0.1}}
        return queue_only.post("/v1/jobs", json={"solver": "dehydration", "params": params, "need": need})

    problem = checked(ask("a" * 64), 422, "invalid-input")
    assert "pattern.key: no result is stored under aaaa" in problem["detail"]
    assert "Run that one first" in problem["advice"]
    assert checked(ask("../../etc/passwd"), 422, "invalid-input")["advice"]
    assert Queue(store.ledger).waiting() == []
    (own,) = fill(store, te=[0.03], gamma=[10.0])
    packed = next(iter(Store(starter.ROOT).keys()))
    assert [ask(key).status_code for key in (own, packed)] == [202, 202]


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


def test_what_was_given_up_and_came_from_elsewhere_is_had(store: Store, queue_only: httpx.Client) -> None:
    """As when another machine's results were copied into the store."""
    job = queue_only.post("/v1/jobs", json=body(trouble="diverges")).json()
    drain(store)
    solver = registry.get("shrinking")
    spec = store.ledger.get(job["id"])
    result = solver.solve(solver.parse({**spec.params, "trouble": ""}), Need.parse(spec.need))
    store.put(job["id"], result)
    assert queue_only.post("/v1/jobs", json=body(trouble="diverges")).json()["state"] == "wanted"
    assert drain(store) == 0, "it is here already"
    assert queue_only.get(job["links"]["self"]).json()["state"] == "done"


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


def hold(log: Path, after: int) -> None:
    """Let jobs with the trouble "waits" wait in their middle, from so many solves on."""
    Path(f"{log}.hold").write_text(str(after))


def let_go(log: Path) -> None:
    Path(f"{log}.hold").unlink(missing_ok=True)


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
    hold(log, 5)
    first, address = serve(store)
    with httpx.Client(base_url=address, headers=headers, timeout=120) as client:
        until(lambda: answers(client))
        asked = [client.post("/v1/jobs", json=body(0.02 + 0.002 * i, trouble="waits")) for i in range(10)]
    assert {answer.status_code for answer in asked} == {202}
    until(lambda: store.ledger.counts()["done"] >= 2 and store.ledger.counts()["running"] > 0)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    before = store.ledger.counts()["done"]
    assert 2 <= before < 10
    let_go(log)
    second, address = serve(store)
    try:
        with httpx.Client(base_url=address, timeout=120) as client:
            until(lambda: answers(client))
            until(lambda: len(client.get("/v1/jobs?state=done").json()["jobs"]) == 10)
            for answer in asked:
                assert client.get(f"{answer.headers['location']}/result").status_code == 200
    finally:
        second.send_signal(signal.SIGTERM)
        second.communicate(timeout=120)
    # the kill interrupted at most one solve per worker
    assert 10 <= len(log.read_text().splitlines()) <= 12


def test_two_services_run_no_job_twice(store: Store, log: Path) -> None:
    apps = [create_app(Settings(store=store.root)) for _ in range(2)]
    headers = bearer(store)
    with served(apps[0]) as one, served(apps[1]) as two:
        asked = [c.post("/v1/jobs", json=body(0.02 + 0.01 * i), headers=headers) for i in range(3) for c in (one, two)]
        assert len({answer.json()["id"] for answer in asked}) == 3
        until(lambda: len(two.get("/v1/jobs?state=done").json()["jobs"]) == 3)
    assert len(log.read_text().splitlines()) == 3


def test_streams_of_events_are_counted(store: Store) -> None:
    """One too many is refused, and may come when another has ended."""
    with client_of(store.root, jobs_workers=0, max_listeners=2) as client:
        client.headers.update(bearer(store))
        url = client.post("/v1/jobs", json=body()).headers["location"] + "/events"
        with client.stream("GET", url) as one, client.stream("GET", url) as two:
            lines = [stream.iter_lines() for stream in (one, two)]  # kept: a dropped one would close its stream
            assert {next(each) for each in lines} == {"retry: 1000"}
            # a stream, were there one, would not end
            with client.stream("GET", url) as third:
                assert third.status_code == 429
                third.read()
            checked(third, 429, "too-many-listeners")

        def free() -> bool:
            with client.stream("GET", url) as again:
                return again.status_code == 200

        until(free)


def test_tokens_that_are_made_up_are_one_listener(store: Store) -> None:
    with client_of(store.root, jobs_workers=0, max_listeners_per_client=1) as client:
        url = client.post("/v1/jobs", json=body(), headers=bearer(store)).headers["location"] + "/events"
        with client.stream("GET", url, headers={"Authorization": "Bearer x"}) as one:
            lines = one.iter_lines()
            assert next(lines) == "retry: 1000"
            with client.stream("GET", url, headers={"Authorization": "Bearer y"}) as two:
                assert two.status_code == 429
            with client.stream("GET", url, headers=bearer(store, "other")) as three:
                assert three.status_code == 200


def test_the_head_of_a_stream_ends(store: Store) -> None:
    with client_of(store.root, jobs_workers=0, max_listeners=1) as client:
        url = client.post("/v1/jobs", json=body(), headers=bearer(store)).headers["location"] + "/events"
        for _ in range(3):
            head = client.head(url, timeout=10)
            assert (head.status_code, head.content) == (200, b"")
            assert head.headers["content-type"].startswith("text/event-stream")
        with client.stream("GET", url) as stream:
            assert stream.status_code == 200


def test_lists_read_a_mesh_once(store: Store, queue_only: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as a page has room for: each was read again at every look, once there were many."""
    long = {"mesh": {"points": list(range(3000))}}
    many = [JobSpec(f"{i:064x}", "growth", "1", {**long, "seed": i}, {"stages": [0.1]}) for i in range(150)]
    store.ledger.want(many)
    read: list[str] = []
    size = views._size
    monkeypatch.setattr(views, "_size", lambda value, enough: read.append("") or size(value, enough))
    first, second = (queue_only.get("/v1/jobs?limit=200").json()["jobs"] for _ in range(2))
    assert (len(first), first) == (150, second)
    assert {tuple(job["omitted"]) for job in first} == {("mesh",)}
    once = len(read)
    queue_only.get("/v1/jobs?limit=200")
    assert 0 < once == len(read)
    # those that nobody asked for lately are forgotten, and not all of them
    (last, *_) = store.ledger.jobs()
    kept = f"{views._FEW:064x}"
    for i in range(views._FEW + 10):
        for key in (f"{i:064x}", kept):
            views._shortened(dataclasses.replace(last, key=key))
    assert len(views._SHORT) == views._FEW > 200
    assert kept in views._SHORT


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
    assert not get["security"], "reading is open here"
    assert document["components"]["securitySchemes"]["token"]["scheme"] == "bearer"


def test_the_starter_takes_no_jobs() -> None:
    from store.starter import ROOT as STARTER

    before = sorted(STARTER.rglob("*"))
    with client_of(STARTER) as client:
        assert client.get("/v1/jobs").json() == {"jobs": [], "next": None}
        checked(client.post("/v1/jobs", json=body()), 401, "unauthorized")
    assert sorted(STARTER.rglob("*")) == before
