"""One question over all tables by HTTP: presets, the family that answers, and what to do where none does."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

from solver.dehydration import SOLVER
from solver.fruit import lattice
from store import starter, tables
from store.store import Store

from ..store.conftest import displacement, fill
from ._asking import checked
from ._jobs import bearer
from .conftest import SHAPE, client_of

RAISIN = dict(SOLVER.presets["raisin"])
PLAN = 'solver = "dehydration"\npreset = "raisin"\n'


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Spheres, and raisins of which a quarter was solved, as their metadata say."""
    store = Store.open(tmp_path_factory.mktemp("families") / "store", create=True)
    keys = fill(store, te=[0.03, 0.04], gamma=[10.0, 30.0])
    tables.build(store, SOLVER, "sphere", keys=keys)
    fruit = {name: RAISIN[name] for name in ("radii", "stone")}
    keys = fill(store, te=[0.01, 0.02], gamma=[5.0, 20.0], mirrors="xz", **fruit)
    tables.build(store, SOLVER, "raisin", keys=keys, text=PLAN)
    return store.root


@pytest.fixture(scope="module")
def client(house: Path) -> Iterator[httpx.Client]:
    with client_of(house, jobs_workers=0) as client:
        yield client


@pytest.fixture(scope="module")
def allowed(house: Path) -> dict[str, str]:
    return bearer(Store.open(house))


def test_a_preset_fills_what_is_not_said(client: httpx.Client) -> None:
    said = {"preset": "raisin", "s": 0.2, "te": 0.02, "gamma": 5, "resolution": 16, "format": "npz"}
    answer = client.get(SHAPE, params=said)
    assert answer.status_code == 200
    # fruits of other families have the same numbers
    assert 'filename="dehydration-raisin-te0.02-gamma5-s0.2.npz"' in answer.headers["content-disposition"]
    fresh = SOLVER.parse({"te": 0.02, "gamma": 5.0}, "raisin").surface(*lattice(16))
    with np.load(io.BytesIO(answer.content)) as archive:
        assert np.abs(archive["position"] - fresh - displacement(0.02, 5.0, 0.2, 16)).max() < 1e-5
    plain = client.get(SHAPE, params={"preset": "raisin", "s": 0.2, "format": "json"}).json()
    assert plain["table"] == "raisin"
    assert (plain["params"]["te"], plain["params"]["gamma"], plain["params"]["r4"]) == (0.01, 10.0, 0.45)
    assert plain["made"] == {"mirrors": "xz"}
    assert client.get(SHAPE, params={"te": 0.03, "gamma": 10, "s": 0.2, "format": "json"}).json()["table"] == "sphere"


def test_what_nobody_says_is_the_solvers_default(client: httpx.Client) -> None:
    said = {"te": 0.03, "s": 0.2, "format": "json"}
    plain, named = (client.get(SHAPE, params=params) for params in (said, {**said, "gamma": 10}))
    assert (plain.json()["table"], plain.json()["params"]["gamma"]) == ("sphere", 10.0)
    assert plain.headers["etag"] == named.headers["etag"]
    # a table that is named asks for its axes
    assert client.get(SHAPE, params={**said, "table": "sphere"}).json()["errors"][0]["name"] == "gamma"


def test_who_named_a_preset_is_not_told_to_leave_out_its_numbers(client: httpx.Client) -> None:
    said = {"preset": "potato", "s": 0.2, "format": "json"}
    told = {wrong["name"]: wrong["advice"] for wrong in client.get(SHAPE, params=said).json()["errors"]}
    assert told
    assert all("That is of the preset potato: choose another" in advice for advice in told.values())
    again = client.get(SHAPE, params={**said, "rs1": 0.35}).json()["errors"]
    (own,) = (wrong["advice"] for wrong in again if wrong["name"] == "rs1")
    assert own == "Set rs1=0.4."


def test_how_a_run_was_done_may_be_named(client: httpx.Client) -> None:
    said = {"preset": "raisin", "s": 0.2, "format": "json"}
    assert client.get(SHAPE, params={**said, "mirrors": "xz"}).json()["made"] == {"mirrors": "xz"}
    refused = client.get(SHAPE, params={**said, "mirrors": "xyz"})
    assert refused.status_code == 422
    assert "this table holds mirrors = 'xz' only, not 'xyz'" in refused.text
    assert "exact=run or exact=relax" in client.get(SHAPE, params={**said, "exact": "foo"}).text


@pytest.mark.parametrize(
    ("said", "table", "name"),
    [
        ({"te": 0.035, "mirrors": "xyz"}, "sphere", "mirrors"),
        ({"preset": "raisin", "mirrors": "x"}, "raisin", "mirrors"),
        ({"te": 0.035, "imperfection_kind": "mode"}, "sphere", "imperfection_kind"),
    ],
)
def test_a_word_that_no_table_holds_is_run(
    client: httpx.Client, allowed: dict[str, str], said: dict[str, Any], table: str, name: str
) -> None:
    problem = checked(client.get(SHAPE, params={**said, "s": 0.2}), 422, "outside-table")
    assert (problem["nearest"]["table"], [w["name"] for w in problem["errors"]]) == (table, [name])
    assert f"--set {name}={said[name]}" in problem["links"]["command"]
    run = client.get(problem["links"]["exact"], headers=allowed, follow_redirects=False)
    assert client.get(run.headers["location"]).json()["params"][name] == said[name]


def test_a_word_that_there_is_not_is_not_sent_to_a_run(client: httpx.Client, allowed: dict[str, str]) -> None:
    said = {"te": 0.035, "s": 0.2, "imperfection_kind": "bumps"}
    problem = checked(client.get(SHAPE, params=said), 422, "outside-table")
    assert "links" not in problem
    assert "No run can be like that either: imperfection_kind" in problem["advice"]
    checked(client.get(SHAPE, params={**said, "exact": "run"}, headers=allowed), 422, "invalid-input")


def test_parameters_are_named_as_on_the_command_line(client: httpx.Client) -> None:
    plain = client.get(SHAPE, params={"te": 0.035, "s": 0.2, "format": "npz"})
    for same in (
        {"te": 0.035, "stone": "0.4,0.4"},
        {"exocarp_thickness": 0.035},
        {"te": 0.035, "radii": "1" + ",1" * 7},
    ):
        assert client.get(SHAPE, params={**same, "s": 0.2, "format": "npz"}).headers["etag"] == plain.headers["etag"]
    for wrong, words in (
        ({"stone": "0.4"}, "Write it like stone=0.4,0.4, or say rs1 and rs2."),
        ({"radii": "2" + ",1" * 7}, "Write 1 there."),
        ({"pattern": "x"}, "POST /v1/jobs"),
        ({"exocarp_thickness": 0.03}, "Give it once."),
    ):
        problem = checked(client.get(SHAPE, params={"te": 0.035, "s": 0.2, **wrong}), 422, "invalid-query")
        assert words in problem["advice"]


def test_what_a_preset_says_is_not_the_askers_where_a_table_is_named(client: httpx.Client) -> None:
    said = {"preset": "potato", "s": 0.2, "table": "raisin"}
    problem = checked(client.get(SHAPE, params=said), 422, "outside-table")
    assert "Leave" not in problem["advice"]
    assert problem["advice"].count("That is of the preset potato: choose another preset, or another table.") == 1
    again = client.get(SHAPE, params={**said, "rs1": 0.35}).json()["errors"]
    assert next(w["advice"] for w in again if w["name"] == "rs1") == "Set rs1=0.3, or choose another table."


def test_what_names_there_are_is_said_where_they_work(client: httpx.Client) -> None:
    problem = client.get(SHAPE, params={"preset": "raisin", "s": 0.2, "zzzz": 1}).json()
    assert {"mirrors", "hours", "under", "preset"} <= set(problem["advice"].removeprefix("Known: ")[:-1].split(", "))
    assert "Did you mean 'hours'?" in client.get(SHAPE, params={"preset": "raisin", "hour": 48}).text
    body = {"solver": "dehydration", "preset": "raisin", "points": [{"s": 0.2, "zzzz": 1}]}
    (wrong,) = client.post("/v1/shapes:batch", json=body).json()["errors"]
    known = set(wrong["advice"].removeprefix("Known: ")[:-1].split(", "))
    assert {"te", "gamma", "s", "seed", "screen_px"} <= known
    assert not known & {"mirrors", "hours", "preset", "format", "method", "table"}


@pytest.mark.parametrize("text", ["0_0.035", "\uff10.\uff10\uff13", "\u0661"])
@pytest.mark.parametrize("name", ["te", "resolution", "screen_px", "region", "max_error"])
def test_numbers_are_plain_digits(client: httpx.Client, name: str, text: str) -> None:
    text = "45:90,0:\u0661" if name == "region" else text
    answer = client.get(SHAPE, params={"te": 0.035, "s": 0.2, "format": "npz", name: text})
    assert checked(answer, 422, "invalid-query")["errors"][0]["name"] == name


def test_nothing_has_no_sign(client: httpx.Client) -> None:
    said = client.get(SHAPE, params={"te": 0.035, "s": "-0.0", "format": "json"})
    assert str(said.json()["stage"]["value"]) == "0.0"
    plain = client.get(SHAPE, params={"te": 0.035, "s": "-0.0", "format": "obj"})
    assert "s0.obj" in plain.headers["content-disposition"]


def test_all_radii_typed_in_are_that_fruit(client: httpx.Client) -> None:
    radii = {f"r{i + 1}": r for i, r in enumerate(RAISIN["radii"]) if i}
    said = {**radii, "rs1": 0.3, "rs2": 0.2, "te": 0.01, "gamma": 10, "s": 0.2, "format": "json"}
    assert client.get(SHAPE, params=said).json()["table"] == "raisin"


def test_what_no_family_holds_names_the_nearest_and_the_run(
    client: httpx.Client, house: Path, allowed: dict[str, str]
) -> None:
    said: dict[str, Any] = {"preset": "raisin", "te": 0.03, "s": 0.2, "format": "npz"}
    answer = client.get(SHAPE, params=said)
    problem = answer.json()
    assert (answer.status_code, problem["type"]) == (422, "urn:wizen:problem:outside-table")
    assert problem["nearest"]["table"] == "raisin"
    assert problem["nearest"]["parameters"] == {"te": {"asked": 0.03, "nearest": 0.02, "distance": 0.405465}}
    typed = "wizen solve dehydration --preset raisin --set te=0.03 --set mirrors=xz --stages 0.2 "
    assert problem["links"]["command"].startswith(typed)
    assert [wrong["name"] for wrong in problem["errors"]] == ["te"]
    store = Store.open(house)
    run = client.get(problem["links"]["exact"], headers=allowed, follow_redirects=False)
    assert run.status_code == 303
    job = next(job for job in store.ledger.jobs() if run.headers["location"].endswith(job.key))
    assert (job.params["exocarp_thickness"], job.params["radii"]) == (0.03, list(RAISIN["radii"]))
    assert job.params["mirrors"] == "xz"  # the table holds that fruit: the run goes with its samples


@pytest.mark.parametrize("said", [{"gamma": "5e-324"}, {"te": "1e308"}, {"te": "-1e308"}])
def test_numbers_at_the_end_of_all_numbers_are_off_the_table(client: httpx.Client, said: dict[str, str]) -> None:
    problem = checked(client.get(SHAPE, params={"preset": "raisin", "s": 0.2, **said}), 422, "outside-table")
    (name,) = said
    asked, nearest, distance = problem["nearest"]["parameters"][name].values()
    assert asked == float(said[name])
    assert nearest > 0
    assert distance <= problem["nearest"]["distance"] < math.inf


@pytest.mark.parametrize("said", [{"te": -1}, {"te": 0.5}, {"s": 10}, {"te": 0.005, "rs1": 0.99}])
def test_no_run_is_offered_of_what_no_fruit_can_be(
    client: httpx.Client, allowed: dict[str, str], said: dict[str, Any]
) -> None:
    asked = {"preset": "raisin", "s": 0.2, **said}
    problem = checked(client.get(SHAPE, params=asked), 422, "outside-table")
    assert "links" not in problem
    assert "exact=run" not in problem["advice"]
    run = client.get(SHAPE, params={**asked, "exact": "run"}, headers=allowed, follow_redirects=False).json()
    why = f"{run['detail']} {run.get('advice', '')}".strip()
    assert problem["advice"].endswith(f"No run can be like that either: {why}")


def test_the_package_offers_the_command_alone() -> None:
    with client_of(starter.ROOT) as client:
        problem = checked(client.get(SHAPE, params={"preset": "raisin", "te": 0.05, "s": 0.2}), 422, "outside-table")
    assert set(problem["links"]) == {"command"}
    assert "exact=run" not in problem["advice"]
    assert "command" in problem["advice"]


def test_what_lies_just_off_a_table_is_told_in_all_its_digits(client: httpx.Client) -> None:
    problem = checked(client.get(SHAPE, params={"preset": "raisin", "s": 0.3000001}), 422, "outside-table")
    assert "0.3000001" in problem["detail"]
    assert "--stages 0.3000001 " in problem["links"]["command"]


def test_a_fruit_that_no_table_has_is_run_whole(client: httpx.Client, house: Path, allowed: dict[str, str]) -> None:
    problem = client.get(SHAPE, params={"preset": "plum2", "s": 0.2}).json()
    assert problem["nearest"]["table"] == "sphere"
    assert {"r8", "rs1"} <= set(problem["nearest"]["parameters"])
    assert problem["detail"].startswith("no table holds this; the nearest is 'sphere'")
    assert "Leave r8 out" not in problem["advice"]
    store = Store.open(house)
    run = client.get(problem["links"]["exact"], headers=allowed, follow_redirects=False)
    job = next(job for job in store.ledger.jobs() if run.headers["location"].endswith(job.key))
    assert job.params == SOLVER.parse({}, "plum2").model_dump(mode="json")


def test_unknown_presets_and_presets_of_another_table(client: httpx.Client) -> None:
    problem = client.get(SHAPE, params={"preset": "raisn", "s": 0.2}).json()
    assert (problem["status"], problem["errors"][0]["name"]) == (422, "preset")
    assert "did you mean 'raisin'?" in problem["advice"]
    problem = client.get(SHAPE, params={"preset": "raisin", "s": 0.2, "table": "sphere"}).json()
    assert problem["status"] == 422
    assert "r4" in {wrong["name"] for wrong in problem["errors"]}
    assert client.get(SHAPE, params={"preset": "raisin"}).json()["errors"][0]["name"] == "s"


def test_a_batch_finds_the_family_of_all_its_points(client: httpx.Client) -> None:
    body: dict[str, Any] = {"solver": "dehydration", "preset": "raisin", "points": {"s": [0.1, 0.2]}, "format": "json"}
    lines = client.post("/v1/shapes:batch", json=body).text.splitlines()
    assert len(lines) == 2
    assert '"raisin"' in lines[0]
    wrong = client.post("/v1/shapes:batch", json={**body, "preset": "raisn"})
    assert (wrong.status_code, wrong.json()["errors"][0]["name"]) == (422, "preset")
    mixed = {**body, "points": [{"s": 0.1}, {"s": 0.1, "te": 0.05}]}
    assert [e["name"] for e in client.post("/v1/shapes:batch", json=mixed).json()["errors"]] == ["points[1].te"]


def test_maps_say_what_is_covered(client: httpx.Client) -> None:
    raisin, sphere = client.get("/v1/maps").json()["maps"]
    assert (raisin["name"], raisin["presets"], raisin["made"]) == ("raisin", ["raisin"], {"mirrors": "xz"})
    assert raisin["axes"]["te"] == {"lowest": 0.01, "highest": 0.02, "values": [0.01, 0.02], "units": "r1"}
    assert [stage["converged"] for stage in sphere["stages"]] == [4, 4, 4]
    assert raisin["portrait"] == {"te": 0.01, "gamma": 10.0, "s": 0.2}
    assert sphere["is_current"]
    assert "plan" not in sphere["links"]
    assert client.get(raisin["links"]["plan"]).text == PLAN
    assert client.get("/v1/maps/sphere/plan.toml").status_code == 404
    answer = client.get(raisin["links"]["thumbnail"])
    picture = np.asarray(Image.open(io.BytesIO(answer.content)))
    assert picture.shape == (160, 160, 3)
    assert np.ptp(picture[40:120, 40:120]) > 30
    again = client.get(raisin["links"]["thumbnail"], headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304
    assert client.get("/v1/maps/rasin/thumbnail.png").status_code == 404


def test_a_picture_has_the_colours_of_its_fruit() -> None:
    """`prolate` is a table's name and no fruit's: raisin2, which it holds, is as dark as raisins are."""
    with client_of(starter.ROOT) as client:
        maps = {one["name"]: one for one in client.get("/v1/maps").json()["maps"]}
        colours = {}
        for name, preset in (("raisin", "raisin"), ("prolate", "raisin2"), ("jujube1", "jujube1")):
            assert maps[name]["presets"] == [preset]
            picture = Image.open(io.BytesIO(client.get(maps[name]["links"]["thumbnail"]).content))
            middle = np.asarray(picture, float)[60:100, 60:100].reshape(-1, 3).mean(axis=0)
            colours[name] = middle / middle.sum()
    apart = {name: float(np.abs(colours["prolate"] - colours[name]).max()) for name in ("raisin", "jujube1")}
    assert apart["raisin"] < 0.02
    assert apart["jujube1"] > 0.1


def test_a_family_of_a_single_fruit(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    fruit = SOLVER.presets["wolfberry"]
    keys = fill(store, te=[0.005], gamma=[10.0], radii=fruit["radii"], stone=fruit["stone"])
    tables.build(store, SOLVER, "wolfberry", keys=keys, dtype="int16")
    tables.build(store, SOLVER, "sphere", keys=fill(store, te=[0.03, 0.04], gamma=[10.0]))
    with client_of(store.root) as client:
        answer = client.get(SHAPE, params={"preset": "wolfberry", "s": 0.25, "format": "json"}).json()
        assert (answer["table"], answer["params"]["te"]) == ("wolfberry", 0.005)
        refused = client.get(SHAPE, params={"preset": "wolfberry", "te": 0.01, "s": 0.25}).json()
        assert refused["nearest"]["parameters"]["te"] == {"asked": 0.01, "nearest": 0.005, "distance": 0.693147}
        berry = client.get("/v1/maps").json()["maps"][1]
        assert (berry["name"], berry["axes"], berry["presets"]) == ("wolfberry", {}, ["wolfberry"])
        assert client.get(berry["links"]["thumbnail"]).status_code == 200


def test_an_answer_kept_is_not_given_once_another_family_is_nearer(house: Path, tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    tables.build(store, SOLVER, "wide", keys=fill(store, te=[0.02, 0.06], gamma=[5.0, 60.0]))
    query = {"te": 0.04, "gamma": 20, "s": 0.2, "resolution": 16, "format": "npz"}
    with client_of(store.root, reload_interval=0) as client:
        first = [client.get(SHAPE, params=query) for _ in range(2)][-1]
        assert "kept" in first.headers["server-timing"]
        tables.build(store, SOLVER, "near", keys=fill(store, te=[0.03, 0.04], gamma=[20.0, 30.0]))
        assert client.get(SHAPE, params=query).headers["etag"] != first.headers["etag"]
