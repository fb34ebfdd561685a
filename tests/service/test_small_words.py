"""Small promises of the interface: lists that are whole, methods that are told, numbers that are numbers."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from store.store import Store

from ._asking import checked
from ._jobs import bearer
from .conftest import QUERY, SHAPE, client_of


def test_pixels_are_those_of_the_lattice_that_is_sent(client: httpx.Client) -> None:
    asked = {name: value for name, value in QUERY.items() if name != "resolution"}
    for pixels, expected in ((100, 4.0), (100_000, 4 * 39272 / 512)):
        detail = client.get(SHAPE, params={**asked, "screen_px": pixels, "format": "json"}).json()["detail"]
        assert detail["pixels_per_cell"] == pytest.approx(expected, abs=1e-3)


def test_an_unknown_method_is_one_kind_of_problem(client: httpx.Client) -> None:
    body = {"solver": "dehydration", "points": [{"te": 0.03, "gamma": 7, "s": 0.2}], "method": "magic"}
    one = checked(client.get(SHAPE, params={**QUERY, "method": "magic"}), 422, "invalid-query")
    many = checked(client.post("/v1/shapes:batch", json=body), 422, "invalid-query")
    for problem in (one, many):
        assert problem["errors"][0]["name"] == "method"
        assert "scattered" in problem["advice"]
    assert client.post("/v1/shapes:batch", json={**body, "method": "scattered"}).status_code == 200
    assert "scattered" in client.get("/v1/tables/default").json()["methods"]["known"]


def test_what_is_linked_is_there(client: httpx.Client) -> None:
    assert "shapes" in client.get("/v1/solvers/dehydration").json()["links"]
    for name in ("decay", "growth", "wood"):
        links = client.get(f"/v1/solvers/{name}").json()["links"]
        assert "shapes" not in links
        assert client.get(links["jobs"]).status_code == 200
    listed = set(client.get("/").json()["links"].values())
    plain = {path for path in client.get("/openapi.json").json()["paths"] if "{" not in path}
    assert plain - {"/"} <= listed


def test_results_of_a_solver_that_is_not_there(client: httpx.Client) -> None:
    assert client.get("/v1/results", params={"solver": "wood"}).json()["results"] == []
    problem = checked(client.get("/v1/results", params={"solver": "woood"}), 404, "unknown-solver")
    assert "did you mean 'wood'" in problem["advice"]


@pytest.mark.parametrize(
    "params", [{"gamma": True}, {"te": "0.04"}, {"stone": [0.4, "0.4"]}, {"exocarp_thickness": "0.04"}]
)
def test_numbers_of_a_job_are_numbers(own: Store, params: dict[str, Any]) -> None:
    with client_of(own.root, jobs_workers=0) as client:
        body = {"solver": "dehydration", "preset": "sphere", "params": params, "need": {"stages": [0.1]}}
        problem = checked(client.post("/v1/jobs", json=body, headers=bearer(own)), 422, "invalid-query")
        assert problem["errors"][0]["name"] == f"params.{next(iter(params))}"
        sound = {**body, "params": {"te": 0.04, "gamma": 20, "stone": [0.4, 0.3], "mirrors": "xz"}}
        assert client.post("/v1/jobs", json=sound, headers=bearer(own, "other")).status_code == 202


@pytest.mark.parametrize(
    ("path", "allowed"), [("/v1/tables", "GET, HEAD"), ("/v1/jobs", "GET, HEAD, POST"), ("/v1/shapes:batch", "POST")]
)
def test_all_methods_are_told(client: httpx.Client, path: str, allowed: str) -> None:
    refused = client.put(path)
    assert (refused.status_code, refused.headers["allow"]) == (405, allowed)
    assert refused.json()["instance"] == path
    assert allowed in refused.json()["advice"]
    if "HEAD" in allowed:
        assert client.head(path).status_code == 200


def test_sentences_end_once(client: httpx.Client) -> None:
    asked = {"preset": "raisin", "hours": 48, "under": "temprature:60"}
    said = client.get(SHAPE, params=asked).json()["detail"]
    assert said.endswith("did you mean 'temperature'?"), said
