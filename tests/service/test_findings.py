"""Bodies and queries that their model refuses: each finding where it is in what was sent, with advice."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from ._asking import checked

BATCH = "/v1/shapes:batch"
POINT = {"te": 0.03, "gamma": 7.0, "s": 0.2}


@pytest.mark.parametrize(
    ("body", "names"),
    [
        ({}, ["solver", "points"]),
        ([], ["body"]),
        ("[0.1]", ["body"]),
        ({"solver": "dehydration", "points": []}, ["points"]),
        ({"solver": "dehydration", "points": {"s": []}}, ["points.s"]),
        ({"solver": "dehydration", "points": {"s": [0.1, "0.2"]}}, ["points.s.1"]),
        ({"solver": "dehydration", "points": {"s": [0.1, True], "te": "thick"}}, ["points.s.1", "points.te"]),
        ({"solver": "dehydration", "points": [POINT, {**POINT, "te": "thick"}]}, ["points.1.te"]),
        ({"solver": "dehydration", "points": [POINT], "resolution": 3}, ["resolution"]),
        ({"solver": "dehydration", "points": [POINT], "format": "zip", "colour": 1}, ["format", "colour"]),
        # neither form is nearer
        ({"solver": "dehydration", "points": 3}, ["points"]),
    ],
)
def test_a_finding_is_named_by_its_place_in_what_was_sent(client: httpx.Client, body: Any, names: list[str]) -> None:
    problem = checked(client.post(BATCH, json=body), 422, "invalid-query")
    assert list(dict.fromkeys(wrong["name"] for wrong in problem["errors"])) == names
    assert all(wrong["advice"] for wrong in problem["errors"])
    assert problem["advice"]
    assert "list[" not in problem["detail"]


def test_only_the_form_that_comes_nearest_is_told(client: httpx.Client) -> None:
    body = b'{"solver": "dehydration", "points": {"s": [0.1, NaN]}}'
    problem = checked(
        client.post(BATCH, content=body, headers={"Content-Type": "application/json"}), 422, "invalid-query"
    )
    (wrong,) = problem["errors"]
    assert (wrong["name"], wrong["advice"]) == ("points.s.1", "Take finite numbers.")
    assert (
        len(checked(client.post(BATCH, json={"solver": "dehydration", "points": 3}), 422, "invalid-query")["errors"])
        == 2
    )


@pytest.mark.parametrize(("sent", "kind"), [(b"a=1", "application/x-www-form-urlencoded"), (b"{", "application/json")])
def test_what_is_no_json_is_told_to_be_some(client: httpx.Client, sent: bytes, kind: str) -> None:
    problem = checked(client.post(BATCH, content=sent, headers={"Content-Type": kind}), 422, "invalid-query")
    assert [wrong["name"] for wrong in problem["errors"]] == ["body"]
    assert "Content-Type: application/json" in problem["advice"]


def test_what_was_sent_is_not_sent_back_at_length(client: httpx.Client) -> None:
    body = {"solver": "dehydration", "points": {"s": ["x" * 2_000] * 400}}
    answer = client.post(BATCH, json=body)
    checked(answer, 422, "invalid-query")
    assert len(answer.content) < 60_000


@pytest.mark.parametrize(
    "address",
    ["/v1/solvers/dehydration/stages", "/v1/solvers/dehydration/stages?hours=soon", "/v1/jobs?limit=0"],
)
def test_queries_have_advice_too(client: httpx.Client, address: str) -> None:
    problem = checked(client.get(address), 422, "invalid-query")
    assert [bool(wrong["advice"]) for wrong in problem["errors"]] == [True]
