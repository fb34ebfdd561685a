"""Every error is a problem that says what to change, and none is a traceback."""

from __future__ import annotations

import asyncio
import json
import logging
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import BaseModel

from service import errors
from service.app import create_app
from service.settings import Settings
from solver import contract
from store import errors as stored

from ._asking import checked
from .conftest import served

EXPECTED: dict[type[Exception], int] = {
    contract.SolverError: 500,
    contract.InvalidInput: 422,
    contract.InvalidGeometry: 422,
    contract.OverBudget: 422,
    contract.NotConverged: 422,
    contract.Unstable: 422,
    contract.Cancelled: 409,
    stored.StoreError: 500,
    stored.MissingStore: 503,
    stored.CorruptShard: 503,
    stored.CorruptTable: 503,
    stored.CorruptLedger: 503,
    stored.UnknownTable: 404,
    stored.EmptyTable: 503,
    stored.StaleTable: 409,
    stored.OutsideTable: 422,
    stored.TooUncertain: 422,
    stored.MixedSamples: 503,
    stored.StorageFull: 507,
    stored.StorageFailed: 503,
    stored.CorruptBackup: 503,
    stored.UnknownJob: 404,
    stored.QueueFull: 429,
    stored.QuotaSpent: 429,
    stored.ReadOnlyStore: 409,
    stored.NetworkFileSystem: 503,
    stored.CorruptTokens: 503,
    stored.InvalidToken: 422,
    stored.UnknownToken: 404,
    errors.ServiceError: 500,
    errors.InvalidQuery: 422,
    errors.OutsideRanges: 422,
    errors.Uncertain: 422,
    errors.NotAcceptable: 406,
    errors.UnknownPreset: 404,
    errors.UnknownSolver: 404,
    errors.QueryTooLong: 414,
    errors.BodyTooLarge: 413,
    errors.SlowBody: 408,
    errors.TimedOut: 503,
    errors.Overloaded: 503,
    errors.Unauthorized: 401,
    errors.Forbidden: 403,
    errors.TooCostly: 422,
    errors.NotDone: 409,
    errors.JobFailed: 409,
    errors.JobEnded: 409,
    errors.Overloaded: 503,
    errors.TooManyListeners: 429,
    errors.UncertainBatch: 422,
    errors.UnfitFormat: 422,
    errors.Unavailable: 501,
    errors.BatchTooLarge: 413,
    errors.UnknownSession: 404,
    errors.TooManySessions: 429,
    errors.EngineDied: 500,
}


class Body(BaseModel):
    count: int
    width: float


def descendants(kind: type) -> set[type]:
    return {kind}.union(*(descendants(sub) for sub in kind.__subclasses__()))


@pytest.fixture(scope="module")
def faulty(built: Path) -> Iterator[httpx.Client]:
    """A service with routes that fail in every way."""
    app = create_app(Settings(store=built, max_body=100, max_query=200))
    kinds = {kind.__name__: kind for kind in EXPECTED}

    @app.get("/fail/{kind}")
    def fail(kind: str) -> None:
        error: Exception = kinds[kind]("it broke.")
        error.advice = "Mend it."  # type: ignore[attr-defined]
        raise error

    @app.get("/bug")
    def bug() -> None:
        raise ZeroDivisionError("secret detail")

    @app.post("/body")
    def body(value: Body) -> Body:
        return value

    with served(app) as client:
        yield client


@pytest.mark.parametrize(("kind", "status"), EXPECTED.items(), ids=lambda v: getattr(v, "__name__", str(v)))
def test_every_error_has_its_status(faulty: httpx.Client, kind: type[Exception], status: int) -> None:
    problem = checked(faulty.get(f"/fail/{kind.__name__}"), status, kind.code)  # type: ignore[attr-defined]
    assert problem["detail"] == "it broke."
    assert problem["advice"] == "Mend it."
    assert problem["instance"] == f"/fail/{kind.__name__}"


def test_no_error_is_forgotten() -> None:
    ours = descendants(contract.SolverError) | descendants(stored.StoreError) | descendants(errors.ServiceError)
    ours = {kind for kind in ours if kind.__module__ in (contract.errors.__name__, stored.__name__, errors.__name__)}
    assert ours == set(EXPECTED)


def test_a_bug_shows_no_secrets_and_is_logged(faulty: httpx.Client, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR, "wizen.service"):
        answer = faulty.get("/bug", headers={"X-Request-ID": "mine-1"})
    problem = checked(answer, 500, "internal")
    assert problem["request_id"] == "mine-1"
    assert "secret" not in answer.text
    (record,) = [r for r in caplog.records if r.name == "wizen.service"]
    assert record.exc_info
    assert record.request_id == "mine-1"  # type: ignore[attr-defined]


def test_unknown_paths_and_methods(faulty: httpx.Client) -> None:
    problem = checked(faulty.get("/v1/table"), 404, "not-found")
    assert "Did you mean /v1/tables?" in problem["advice"]
    answer = faulty.post("/v1/tables")
    problem = checked(answer, 405, "method-not-allowed")
    assert answer.headers["allow"] == "GET, HEAD"
    assert "Use GET" in problem["advice"]


def test_wrong_bodies_are_listed(faulty: httpx.Client) -> None:
    problem = checked(faulty.post("/body", json={"count": "many"}), 422, "invalid-query")
    assert {wrong["name"] for wrong in problem["errors"]} == {"count", "width"}
    checked(faulty.post("/body", content=b"{", headers={"content-type": "application/json"}), 422, "invalid-query")


def test_too_long_and_too_large(faulty: httpx.Client) -> None:
    checked(faulty.get("/v1/tables?" + "x" * 201), 414, "query-too-long")
    checked(faulty.post("/body", content=b" " * 101), 413, "body-too-large")
    unannounced = (b" " * 60 for _ in range(3))
    checked(faulty.post("/body", content=unannounced), 413, "body-too-large")


def test_a_body_without_end_is_refused_at_its_limit(built: Path) -> None:
    """Not when it has ended: what is sent beyond the limit is not even read."""
    app = create_app(Settings(store=built, max_body=1000))
    read = 0

    async def endless() -> dict[str, Any]:
        nonlocal read
        read += 300
        assert read <= 10_000, "it goes on reading"
        return {"type": "http.request", "body": b" " * 300, "more_body": True}

    said: list[Any] = []

    async def send(message: Any) -> None:
        said.append(message)

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "POST",
        "scheme": "http",
        "path": "/v1/shapes:batch",
        "raw_path": b"/v1/shapes:batch",
        "query_string": b"",
        "headers": [(b"content-type", b"application/json")],
        "server": ("127.0.0.1", 80),
        "client": ("127.0.0.1", 1),
    }
    asyncio.run(app(scope, endless, send))
    assert said[0]["status"] == 413
    assert 1000 < read <= 1300


def test_too_slow(built: Path) -> None:
    """The answer comes after the limit, and before the handler has ended, however busy the machine is."""
    app, go = create_app(Settings(store=built, timeout=2)), threading.Event()

    @app.get("/slow")
    def slow() -> None:
        go.wait(300)

    with served(app) as client:
        begin = time.monotonic()
        try:
            answer = client.get("/slow")
        finally:
            go.set()
        assert time.monotonic() - begin >= 2
        checked(answer, 503, "timed-out")
        assert answer.headers["retry-after"]


def test_strange_characters_stay_a_problem(faulty: httpx.Client) -> None:
    problem = checked(faulty.get("/v1/tables/%00%0a%ff"), 404, "unknown-table")
    assert "\n" not in problem["instance"]
    checked(faulty.get("/v1/shapes/dehydration?%ff=%00&te=\u0661"), 422, "invalid-query")


def test_halves_of_characters_are_told_as_they_were_written(client: httpx.Client) -> None:
    """JSON may hold them, and no UTF-8 does: the error was one inside the handler of errors."""
    item = {"solver": "dehydration", "stage": 0.1, "parameters": {"\ud800": 1}}
    scene = {"camera": {"position": [0, 0, 9]}, "items": [item]}
    batch = {"solver": "dehydration", "points": [{"\ud800": 1}]}
    headers = {"Content-Type": "application/json"}
    for address, body in (("/v1/scenes?format=json", scene), ("/v1/shapes:batch", batch)):
        answer = client.post(address, content=json.dumps(body), headers=headers)
        assert answer.status_code == 422, answer.text
        assert "\\ud800" in checked(answer, 422, answer.json()["type"].rpartition(":")[2])["detail"]


@pytest.mark.parametrize("address", ["/v1/shapes:batch", "/v1/scenes"])
@pytest.mark.parametrize("sent", [b"[" * 100_000, b'{"solver": "\xff"}'])
def test_what_cannot_be_read_has_advice(client: httpx.Client, address: str, sent: bytes) -> None:
    answer = client.post(address, content=sent, headers={"Content-Type": "application/json"})
    assert "JSON" in checked(answer, 400, "bad-request")["advice"]
