"""`GET /v1/results`: pages of what the store holds."""

from __future__ import annotations

import os

import httpx

from store.store import Store

from ._asking import checked
from .conftest import client_of


def test_pages_lead_to_all_results_once(client: httpx.Client) -> None:
    found, address = [], "/v1/results?limit=3&sort=te"
    while address:
        page = client.get(address).json()
        found += page["results"]
        address = page["next"]
    assert len(found) == page["total"]
    assert len({(row["key"], row["stage"]) for row in found}) == len(found)
    assert [row["params"]["te"] for row in found] == sorted(row["params"]["te"] for row in found)
    assert {row["params"]["te"] for row in found} == {0.02, 0.06}


def test_a_damaged_result_is_named_and_the_others_are_listed(own: Store) -> None:
    victim = next(iter(own.keys()))
    with own.shard_path(victim).open("r+b") as file:
        file.seek(-3, os.SEEK_END)
        file.write(b"abc")
    with client_of(own.root) as client:
        page = client.get("/v1/results?last=true").json()
    assert page["damaged"] == [victim]
    assert page["total"] == len(list(own.keys())) - 1 > 0


def test_conditions(client: httpx.Client) -> None:
    page = client.get("/v1/results", params={"where": ["te<0.03", "gamma>5"], "last": True}).json()
    assert [(row["params"]["te"], row["params"]["gamma"]) for row in page["results"]] == [(0.02, 20.0)]
    for params in ({"where": "te"}, {"where": "tea<3"}, {"sort": "tea"}):
        problem = checked(client.get("/v1/results", params=params), 422, "invalid-query")
        assert problem["errors"][0]["name"] in params
    checked(client.get("/v1/results?limit=0"), 422, "invalid-query")


def test_what_is_listed_can_be_had_where_the_ledger_was_lost(own: Store) -> None:
    own.ledger.close()
    for path in own.root.glob("ledger.sqlite*"):
        path.unlink()
    with client_of(own.root) as client:
        row = client.get("/v1/results?last=true&limit=1").json()["results"][0]
        checked(client.get(f"/v1/jobs/{'0' * 64}"), 404, "unknown-job")
        assert not own.ledger.path.exists(), "looking for what is not here begins none"
        answer = client.get(f"/v1/jobs/{row['key']}/result")
        assert (answer.status_code, answer.content[:4]) == (200, b"\x89HDF")
        job = client.get(f"/v1/jobs/{row['key']}").json()
        assert (job["state"], job["version"]) == ("done", row["version"])
        assert len(client.get("/v1/jobs").json()["jobs"]) == 1
