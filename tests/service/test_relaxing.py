"""The tier between table and run by HTTP: asked for like a shape, done as a job, kept as a result."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from solver import registry
from solver.dehydration import SOLVER
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice
from store import tables
from store.errors import EmptyTable
from store.ledger.jobs import JobSpec
from store.lookup import ShapeTable
from store.starter import ROOT as STARTER
from store.store import Store

from ..store.conftest import answer, question
from ..sweeps._command import wizen
from ._asking import checked
from ._jobs import bearer, drain
from .conftest import SHAPE, client_of

#: A quarter of a fruit between two of its samples.
QUERY: dict[str, Any] = {"rs1": 0.45, "te": 0.04, "s": 0.2, "resolution": 64, "table": "stone-radius"}


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A store with one of the families that come with wizen."""
    store = Store.open(tmp_path_factory.mktemp("relaxing") / "store", create=True)
    shutil.copytree(STARTER / "tables" / "stone-radius", store.tables_dir / "stone-radius")
    return store


@pytest.fixture(scope="module")
def client(house: Store) -> Iterator[httpx.Client]:
    with client_of(house.root, jobs_workers=0) as client:
        yield client


@pytest.fixture(scope="module")
def headers(house: Store) -> dict[str, str]:
    return bearer(house)


def ask(client: httpx.Client, headers: dict[str, str] | None = None, **change: Any) -> httpx.Response:
    return client.get(SHAPE, params={**QUERY, **change}, headers=headers)


def test_what_is_looked_up_is_relaxed_once_and_says_so(
    client: httpx.Client, house: Store, headers: dict[str, str]
) -> None:
    checked(ask(client, exact="relax"), 401, "unauthorized")
    plain = ask(client, format="npz")
    assert plain.headers["wizen-tier"] == "table"
    sent = ask(client, headers, exact="relax", format="npz")
    assert (sent.status_code, sent.headers["cache-control"]) == (303, "no-store")
    job = client.get(sent.headers["location"]).json()
    assert (job["state"], job["need"]["stages"], job["need"]["quality"]) == ("wanted", [0.2], "default")
    assert job["need"]["start"]["table"] == "stone-radius"
    assert ask(client, headers, exact="relax", format="glb").headers["location"] == sent.headers["location"]

    assert drain(house) == 1
    asked = {**QUERY, "exact": "relax", "format": "npz"}
    found = client.get(SHAPE, params=asked, headers=headers, follow_redirects=True)
    assert (found.status_code, found.headers["wizen-tier"]) == (200, "relaxed")
    with np.load(io.BytesIO(found.content)) as relaxed, np.load(io.BytesIO(plain.content)) as looked:
        assert json.loads(str(relaxed["about"]))["tier"] == "relaxed"
        assert json.loads(str(looked["about"]))["tier"] == "table"
        whole = np.concatenate([relaxed["position"].reshape(-1, 3), relaxed["poles"]])
        radii = [np.linalg.norm(one["position"], axis=-1).ravel() for one in (relaxed, looked)]
    assert crossings(whole, closed_lattice(64)).count == 0
    assert np.corrcoef(*radii)[0, 1] > 0.8
    assert np.abs(radii[0] - radii[1]).max() > 1e-4
    said = [ask(client, headers, format="json", **how) for how in ({}, {"exact": "relax"})]
    table, kept = (client.get(one.headers.get("location", one.url)).json() for one in said)
    assert {"buckle_count", *table["descriptors"]} <= {*kept["descriptors"]}
    assert (kept["tier"], kept["exact"], kept["expected_error"]) == ("relaxed", False, None)
    assert kept["nearest"] == table["nearest"] > 0
    assert [kept[name] for name in ("inside", "held", "weights")] == [table[n] for n in ("inside", "held", "weights")]
    numbers = client.get(f"{sent.headers['location']}/fields", params={"names": "residual,moved,converged"}).json()
    assert numbers["fields"]["residual"]["values"][0] <= 5e-3
    assert numbers["fields"]["converged"]["values"] == [1]
    assert 0 < numbers["fields"]["moved"]["values"][0] < 1
    # what was relaxed is no sample of a table
    with pytest.raises(EmptyTable):
        tables.build(house, SOLVER, "wrong")


def test_what_cannot_be_relaxed_is_refused(client: httpx.Client, headers: dict[str, str]) -> None:
    refused = checked(ask(client, headers, exact="relax", te=0.07), 422, "outside-table")
    assert "exact=run" in refused["advice"]
    checked(ask(client, headers, exact="relax", max_error="0.1"), 422, "invalid-query")
    checked(ask(client, headers, exact="soft"), 422, "invalid-query")
    # the fresh shape is in balance
    fresh = ask(client, headers, exact="relax", s=0, format="json")
    assert fresh.headers["wizen-tier"] == "table"
    assert (fresh.json()["tier"], fresh.json()["exact"]) == ("table", True)


def test_a_generation_that_is_gone_is_said(client: httpx.Client, house: Store, headers: dict[str, str]) -> None:
    table = ShapeTable.open(house, "stone-radius", surfaces=registry.surface)
    params = table.at_parameters({"rs1": 0.45, "te": 0.04})
    start = {"table": "stone-radius", "digest": "0" * 64, "method": "idw"}
    body = {"solver": "dehydration", "params": params, "need": {"stages": [0.2], "start": start}}
    asked = client.post("/v1/jobs", json=body, headers=headers)
    assert asked.status_code == 202
    drain(house)
    failed = client.get(asked.headers["location"]).json()
    assert failed["state"] == "failed"
    assert "rebuilt or removed" in failed["problem"]["detail"]
    for wrong, said in (({"stages": [0.1, 0.2]}, "one shape"), ({"tolerance": 0.1}, "tolerance")):
        need = {**body["need"], **wrong}
        refused = client.post("/v1/jobs", json={**body, "need": need}, headers=headers)
        assert said in checked(refused, 422, "invalid-input")["detail"]


def test_a_table_of_another_version_is_refused_with_what_to_rebuild(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "old", create=True)
    for te in (0.03, 0.04):
        params, need = question(te=te, gamma=10.0)
        job = JobSpec.of(replace(SOLVER, version="9"), params, need)
        store.ledger.want([job])
        claim = store.ledger.claim("tester", 60, [job.key])
        store.ledger.done(claim, store.put(job.key, answer(params, need)), 1.0)
    tables.build(store, SOLVER, "old", version="9")
    with client_of(store.root, jobs_workers=0) as client:
        problem = checked(client.get(SHAPE, params={"te": 0.035, "s": 0.2}), 409, "stale-table")
        assert "version 9" in problem["detail"]
        assert "wizen table build" in problem["advice"]
        points = {"solver": "dehydration", "points": [{"te": 0.035, "s": 0.2}]}
        checked(client.post("/v1/shapes:batch", json=points), 409, "stale-table")
        assert client.get("/v1/tables").status_code == 200
        (covered,) = client.get("/v1/maps").json()["maps"]
        assert (covered["version"], covered["is_current"]) == ("9", False)
    typed = wizen("query", "--store", store.root, "--set", "te=0.035", "--stages", "0.2")
    assert typed.exit_code != 0
    assert "version 9" in typed.output
    assert "wizen table build" in " ".join(typed.output.split())
