"""The ways from a refusal to a run lead to one and the same, and to the whole of it."""

from __future__ import annotations

import shlex
import shutil
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
#: What the runs of spheres begin with, and what no store has.
PATTERN, NOBODYS = {"stage": 0.1}, "a" * 64


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Raisins of which a quarter was solved, and spheres that began with a pattern."""
    store = Store.open(tmp_path_factory.mktemp("same") / "store", create=True)
    fruit = {name: RAISIN[name] for name in ("radii", "stone")}
    found = fill(store, te=[0.01, 0.02], gamma=[5.0, 20.0], mirrors="xz", imperfection=0.002, **fruit)
    tables.build(store, SOLVER, "raisin", keys=found)
    found = fill(store, te=[0.03, 0.04], gamma=[10.0, 30.0], pattern={**PATTERN, "key": found[0]})
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


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """Spherical stones, and ellipsoids of which one half-axis says the radii."""
    store = Store.open(tmp_path_factory.mktemp("lines") / "store", create=True)
    for name in ("stone-radius", "prolate"):
        shutil.copytree(starter.ROOT / "tables" / name, store.tables_dir / name)
    with client_of(store.root, jobs_workers=0) as client:
        client.headers.update(bearer(store))
        yield client


@pytest.mark.parametrize("more", [{}, {"gamma": 12}, {"rs2": 0.7}])
def test_what_equals_an_axis_goes_with_it_past_the_table(lines: httpx.Client, more: dict[str, Any]) -> None:
    asked = {"table": "stone-radius", "rs1": 0.7, "te": 0.04, "s": 0.02, **more}
    refused = checked(lines.get(SHAPE, params=asked), 422, "outside-table")
    assert "rs2" not in refused["detail"]
    sent = lines.get(refused["links"]["exact"], follow_redirects=False)
    assert sent.status_code == 303, sent.text
    assert lines.get(sent.headers["location"]).json()["params"]["stone"] == [0.7, 0.7]
    if "command" in refused["links"]:
        assert sent.headers["location"] == f"/v1/jobs/{key_of(refused['links']['command'])}"


@pytest.mark.parametrize("more", [{}, {"gamma": 12}, {"r2": 0.98}])
def test_no_run_is_offered_where_nobody_knows_what_follows(lines: httpx.Client, more: dict[str, Any]) -> None:
    asked = {"table": "prolate", "r4": 0.95, "te": 0.04, "s": 0.1, **more}
    refused = checked(lines.get(SHAPE, params=asked), 422, "outside-table")
    assert "links" not in refused
    assert "what goes with r4 = 0.95 is not known" in refused["advice"]
    again = checked(lines.get(SHAPE, params={**asked, "exact": "run"}, follow_redirects=False), 422, "outside-table")
    assert "r3, r5" in again["advice"]
    # who says what follows has it run
    radii = {"r2": 0.98, "r3": 0.96, "r5": 0.96, "r6": 0.98}
    told = checked(lines.get(SHAPE, params={**asked, **radii}), 422, "outside-table")
    sent = lines.get(told["links"]["exact"], follow_redirects=False)
    found = lines.get(sent.headers["location"]).json()["params"]["radii"]
    assert found == [1, 0.98, 0.96, 0.95, 0.96, 0.98, 1, 0.95]


def test_the_axes_of_a_named_table_keep_their_meaning(lines: httpx.Client) -> None:
    asked = {"table": "prolate", "r4": 0.7, "te": 0.04, "s": 0.1, "gamma": 12}
    refused = checked(lines.get(SHAPE, params=asked), 422, "outside-table")
    sent = lines.get(refused["links"]["exact"], follow_redirects=False)
    assert sent.headers["location"] == f"/v1/jobs/{key_of(refused['links']['command'])}"
    radii = [1, 0.8908, 0.7494, 0.7, 0.7494, 0.8908, 1, 0.7]
    assert lines.get(sent.headers["location"]).json()["params"]["radii"] == radii


def test_a_run_that_begins_with_a_pattern_has_no_command(client: httpx.Client, house: Path) -> None:
    refused = checked(client.get(SHAPE, params={"te": 0.036, "s": 0.2, "max_error": 1e-9}), 422, "too-uncertain")
    assert set(refused["links"]) == {"exact"}
    sent = client.get(refused["links"]["exact"], follow_redirects=False)
    key = client.get(sent.headers["location"]).json()["params"]["pattern"]["key"]
    assert Store.open(house).has(key)


def test_no_run_is_offered_that_begins_with_what_is_not_there(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    found = fill(store, te=[0.03, 0.04], gamma=[10.0], pattern={**PATTERN, "key": NOBODYS})
    tables.build(store, SOLVER, "sphere", keys=found)
    asked = {"te": 0.036, "s": 0.2, "max_error": 1e-9}
    with client_of(store.root, jobs_workers=0) as client:
        client.headers.update(bearer(store))
        refused = checked(client.get(SHAPE, params=asked), 422, "too-uncertain")
        assert "links" not in refused
        sent = client.get(SHAPE, params={**asked, "exact": "run"}, follow_redirects=False)
    why = checked(sent, 422, "invalid-input")
    assert refused["advice"].endswith(f"{why['detail']} {why['advice']}")


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
