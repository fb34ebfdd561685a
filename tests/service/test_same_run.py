"""The ways from a refusal to a run lead to one and the same, and to the whole of it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from solver.contract import Need
from solver.dehydration import SOLVER
from store import keys, starter, tables
from store.store import Store
from sweeps.commands.terminal.options import assignments

from ..store.conftest import fill
from ._asking import checked
from ._jobs import bearer
from .conftest import SHAPE, client_of

RAISIN = dict(SOLVER.presets["raisin"])
PATTERN = {"key": "a" * 64, "stage": 0.1}


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Raisins of which a quarter was solved, and spheres that began with a pattern."""
    store = Store.open(tmp_path_factory.mktemp("same") / "store", create=True)
    fruit = {name: RAISIN[name] for name in ("radii", "stone")}
    found = fill(store, te=[0.01, 0.02], gamma=[5.0, 20.0], mirrors="xz", imperfection=0.002, **fruit)
    tables.build(store, SOLVER, "raisin", keys=found)
    found = fill(store, te=[0.03, 0.04], gamma=[10.0, 30.0], pattern=PATTERN)
    tables.build(store, SOLVER, "sphere", keys=found)
    return store.root


@pytest.fixture(scope="module")
def client(house: Path) -> Iterator[httpx.Client]:
    with client_of(house, jobs_workers=0) as client:
        client.headers.update(bearer(Store.open(house)))
        yield client


def key_of(command: str) -> str:
    """Return the key of the run that a command line is."""
    words = shlex.split(command)
    assert words[:3] == ["wizen", "solve", "dehydration"]
    pairs = list(zip(words[3:-1:2], words[4::2], strict=True))
    said = dict(pairs)
    params = SOLVER.parse(assignments([value for name, value in pairs if name == "--set"]), said.get("--preset"))
    stages = tuple(map(float, said["--stages"].split(",")))
    need = SOLVER.settle(Need.parse({"stages": stages}), said.get("--preset"), (params,))
    return keys.key(SOLVER.name, SOLVER.version, params, need)


@pytest.mark.parametrize(
    "asked",
    [
        {"preset": "raisin", "te": 0.0151, "s": 0.2, "max_error": 1e-9},  # between the samples
        {"preset": "raisin", "te": 0.03, "s": 0.2},  # off an axis
        {"preset": "raisin", "s": 1 / 3},
        {"preset": "raisin", "s": 0.2, "seed": 1},
        {"preset": "raisin", "s": 0.2, "mirrors": "xyz"},
        {"preset": "plum2", "s": 0.2},
        {"te": 0.035, "stone": "0.4,0.3", "s": 0.2},
        {"preset": "potato", "s": 0.2, "table": "raisin"},
    ],
)
def test_the_address_and_the_command_are_one_run(client: httpx.Client, asked: dict[str, Any]) -> None:
    refused = client.get(SHAPE, params=asked)
    assert refused.status_code == 422
    links = refused.json()["links"]
    sent = client.get(links["exact"], follow_redirects=False)
    assert sent.status_code == 303, sent.text
    assert sent.headers["location"] == f"/v1/jobs/{key_of(links['command'])}"


def test_a_run_that_begins_with_a_pattern_has_no_command(client: httpx.Client) -> None:
    refused = checked(client.get(SHAPE, params={"te": 0.036, "s": 0.2, "max_error": 1e-9}), 422, "too-uncertain")
    assert set(refused["links"]) == {"exact"}
    sent = client.get(refused["links"]["exact"], follow_redirects=False)
    assert client.get(sent.headers["location"]).json()["params"]["pattern"]["key"] == PATTERN["key"]


def test_the_package_says_what_its_command_lacks() -> None:
    with client_of(starter.ROOT) as client:
        asked = {"preset": "raisin", "te": 0.0115, "s": 0.2, "max_error": 1e-4}
        refused = checked(client.get(SHAPE, params=asked), 422, "too-uncertain")
    assert "--set mirrors=xz" in refused["links"]["command"]
    assert "have pattern besides" in refused["advice"]


@pytest.mark.parametrize("how", ["run", "relax"])
@pytest.mark.parametrize("part", [{"region": "45:90,0:90"}, {"components": "x"}, {"fields": "position"}])
def test_a_part_is_not_silently_the_whole(client: httpx.Client, how: str, part: dict[str, str]) -> None:
    asked = {"preset": "raisin", "te": 0.0151, "s": 0.2, "max_error": 1e-9, "format": "npz", **part}
    if how == "relax":
        del asked["max_error"]
    refused = checked(client.get(SHAPE, params={**asked, "exact": how}, follow_redirects=False), 422, "invalid-query")
    assert [wrong["name"] for wrong in refused["errors"]] == list(part)
    assert "leave exact out" in refused["advice"]
    kept = {name: value for name, value in asked.items() if name not in part}
    assert client.get(SHAPE, params={**kept, "exact": how}, follow_redirects=False).status_code == 303


def test_the_run_that_is_offered_of_a_part_is_whole(client: httpx.Client) -> None:
    asked = {"preset": "raisin", "te": 0.03, "s": 0.2, "format": "npz", "region": "45:90,0:90"}
    refused = checked(client.get(SHAPE, params=asked), 422, "outside-table")
    assert "whole" in refused["advice"]
    assert client.get(refused["links"]["exact"], follow_redirects=False).status_code == 303
