"""How much solver time may be asked for, and who asked for what."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import httpx
import pytest
from typer.testing import CliRunner

from store.ledger.asks import asks
from store.store import Store
from store.tokens import Tokens
from sweeps.commands.cli import app

from ._asking import checked
from ._jobs import bearer, body, drain
from .conftest import client_of

pytestmark = pytest.mark.usefixtures("shrinking")


def expected(store: Store) -> float:
    """Return what one of these jobs is expected to take."""
    return asks(store.ledger.database)[-1].expected


@pytest.fixture
def open_service(store: Store) -> Iterator[httpx.Client]:
    with client_of(store.root, jobs_workers=0) as client:
        yield client


def test_who_asked_is_noted_without_secrets(store: Store, open_service: httpx.Client) -> None:
    head = bearer(store, "studio")
    job = open_service.post("/v1/jobs", json=body(), headers=head).json()
    open_service.post("/v1/jobs", json=body(), headers=head)  # the same question by the same asker is one ask
    open_service.post("/v1/jobs", json=body(0.05), headers=bearer(store, "other"))
    assert drain(store) == 2
    said = CliRunner().invoke(app, ["audit", "--store", str(store.root), "--token", "studio", "--json"])
    (row,) = json.loads(said.stdout)["asks"]
    assert (row["name"], row["client"], row["key"], row["state"]) == ("studio", "127.0.0.1", job["id"], "done")
    assert row["seconds"] >= 0
    Tokens(store.root).revoke("studio")
    Tokens(store.root).create("quiet", ["run"])
    for token, code in (("studio", 0), ("quiet", 0), ("nobody", 1)):
        seen = CliRunner().invoke(app, ["audit", "--store", str(store.root), "--token", token])
        assert seen.exit_code == code, "what was revoked stays in it, and a mistyped name is no empty list"
    assert "Known: other, quiet, studio." in seen.stderr
    everything = CliRunner().invoke(app, ["audit", "--store", str(store.root)])
    assert "other" in everything.stdout
    secret = head["Authorization"].split("_", 2)[2]  # which may hold a "_" itself
    for path in store.root.rglob("*"):
        assert path.is_dir() or secret.encode() not in path.read_bytes(), path
    assert len(asks(store.ledger.database, time.time() + 1)) == 0


def test_a_token_may_ask_for_so_many_seconds(store: Store, open_service: httpx.Client) -> None:
    one, two = bearer(store, "one"), bearer(store, "two")
    assert open_service.post("/v1/jobs", json=body(), headers=one).status_code == 202
    cost = expected(store)
    with client_of(store.root, jobs_workers=0, max_seconds_per_token=2.5 * cost) as client:
        assert client.post("/v1/jobs", json=body(0.05), headers=one).status_code == 202
        problem = checked(client.post("/v1/jobs", json=body(0.06), headers=one), 429, "quota-spent")
        assert "this token" in problem["detail"]
        assert "UTC" in problem["advice"]
        # what is asked for already is free, and so is another token
        assert client.post("/v1/jobs", json=body(), headers=one).status_code == 202
        assert client.post("/v1/jobs", json=body(0.06), headers=two).status_code == 202
        assert client.post("/v1/jobs", json=body(0.07), headers=bearer(store, "boss", "admin")).status_code == 202
        # what was never begun costs nothing
        gone = client.post("/v1/jobs", json=body(0.05), headers=one).json()["links"]["self"]
        assert client.delete(gone, headers=one).json()["state"] == "cancelled"
        assert client.post("/v1/jobs", json=body(0.08), headers=one).status_code == 202
    # one job alone that is too much
    with client_of(store.root, jobs_workers=0, max_seconds_per_token=0.5 * cost) as client:
        problem = checked(client.post("/v1/jobs", json=body(0.1), headers=two), 429, "quota-spent")
        assert problem["advice"] == "Ask for less."


def test_an_address_may_ask_for_so_many_seconds_with_all_its_tokens(store: Store, open_service: httpx.Client) -> None:
    open_service.post("/v1/jobs", json=body(), headers=bearer(store, "one"))
    with client_of(store.root, jobs_workers=0, max_seconds_per_client=1.5 * expected(store)) as client:
        problem = checked(client.post("/v1/jobs", json=body(0.05), headers=bearer(store, "two")), 429, "quota-spent")
        assert "this address" in problem["detail"]
    with client_of(store.root, jobs_workers=0, max_seconds_per_client=1e-9, quota_hours=1e-9) as client:
        checked(client.post("/v1/jobs", json=body(0.05), headers=bearer(store, "three")), 429, "quota-spent")
