"""Hours over HTTP: the solver's own stages, and a shape that is the one of its stage."""

from __future__ import annotations

import httpx
import pytest

from solver.dehydration import SOLVER

from ._asking import checked
from .conftest import SHAPE

POINT = {"te": 0.03, "gamma": 7.0, "resolution": 16, "format": "points"}


def test_hours_become_stages(client: httpx.Client) -> None:
    said = client.get("/v1/solvers/dehydration/stages", params={"hours": "24,48", "preset": "raisin"}).json()
    assert said["stages"] == list(SOLVER.stages_after([24, 48], {}, "raisin"))
    assert (said["hours"], said["symbol"]) == ([24, 48], "s")
    assert said["conditions"]["temperature"]["units"] == "degC"
    under = "temperature:60,air_speed:1,diameter:22"
    hot = client.get(
        "/v1/solvers/dehydration/stages", params={"hours": "8", "under": under, "preset": "jujube1"}
    ).json()
    conditions = {"temperature": 60, "air_speed": 1, "diameter": 22}
    assert hot["stages"] == list(SOLVER.stages_after([8], conditions, "jujube1"))


@pytest.mark.parametrize(
    ("solver", "query", "status", "code"),
    [
        ("dehydration", {"hours": "30", "preset": "raisin", "under": "temperature:60"}, 422, "invalid-input"),
        ("dehydration", {"hours": "30"}, 422, "invalid-input"),
        ("dehydration", {"hours": "30", "preset": "raisn", "under": "kinetics:grape"}, 422, "invalid-input"),
        ("growth", {"hours": "30"}, 422, "invalid-input"),
        ("dehydration", {"hours": "soon"}, 422, "invalid-query"),
        ("nothing", {"hours": "30"}, 404, "unknown-solver"),
    ],
)
def test_what_has_no_stage_is_refused(
    client: httpx.Client, solver: str, query: dict[str, str], status: int, code: str
) -> None:
    checked(client.get(f"/v1/solvers/{solver}/stages", params=query), status, code)


@pytest.mark.parametrize("hours", ["1e300", "-1", "soon", "", "nan", "1_0", "\u0661"])
def test_stages_and_shapes_say_the_same_of_hours(client: httpx.Client, hours: str) -> None:
    asked = {"hours": hours, "under": "kinetics:grape"}
    one, other = (
        client.get(address, params={**asked, **more}).json()
        for address, more in (("/v1/solvers/dehydration/stages", {}), (SHAPE, POINT))
    )
    assert (one["status"], one["detail"].removeprefix("hours: ")) == (422, other["detail"].removeprefix("hours: "))
    assert one["advice"].removesuffix(",48.").replace("24", "48").rstrip(".") == other["advice"].rstrip(".")


def test_hours_are_written_as_numbers_are(client: httpx.Client) -> None:
    asked = {"hours": "2.4e1,48", "preset": "raisin"}
    assert client.get("/v1/solvers/dehydration/stages", params=asked).json()["hours"] == [24, 48]


def test_a_shape_after_hours_is_the_shape_of_its_stage(client: httpx.Client) -> None:
    (stage,) = SOLVER.stages_after([48], {"kinetics": "grape"})
    after = client.get(SHAPE, params={**POINT, "hours": 48, "under": "kinetics:grape"})
    assert after.status_code == 200, after.text
    assert after.content == client.get(SHAPE, params={**POINT, "s": repr(stage)}).content


@pytest.mark.parametrize(
    "query",
    [
        {"hours": 48},
        {"hours": 48, "under": "kinetics:grape", "s": 0.2},
        {"hours": "soon", "under": "kinetics:grape"},
        {"under": "kinetics:grape"},
        {"hours": 48, "under": "kinetics:grape,temperature:60"},
    ],
)
def test_a_shape_after_hours_that_nobody_measured_is_refused(client: httpx.Client, query: dict[str, object]) -> None:
    problem = checked(client.get(SHAPE, params={**POINT, **query}), 422, "invalid-query")
    assert {wrong["name"] for wrong in problem["errors"]} <= {"hours", "under"}


def test_conditions_are_named_as_a_query_takes_them(client: httpx.Client) -> None:
    asked = {"preset": "jujube1", "hours": 48}
    (wrong,) = checked(client.get(SHAPE, params={**POINT, "hours": 48}), 422, "invalid-query")["errors"]
    assert wrong["advice"].startswith("Say under which conditions: under=kinetics:grape, jujube, or page")
    problem = checked(client.get("/v1/solvers/dehydration/stages", params=asked), 422, "invalid-input")
    assert "For example under=temperature:60,air_speed:1,diameter:22 (C" in problem["advice"]


@pytest.mark.parametrize(
    ("query", "wrong"),
    [
        ([("hours", "48"), ("s", "0.2")], {"hours": "stands beside s"}),
        ([("under", "kinetics:grape"), ("s", "0.2")], {"under": "says how hours are spent, and there are none"}),
        ([("under", "kinetics:grape")], {"hours": "is missing"}),
        ([("hours", "24"), ("hours", "48")], {"hours": "is given more than once"}),
        (
            [("hours", "24"), ("under", "kinetics:grape"), ("under", "diameter:9")],
            {"under": "is given more than once"},
        ),
        ([("hours", "nan"), ("under", "kinetics:grape")], {"hours": "'nan' is not a number of hours"}),
        ([("hours", "1e400"), ("under", "kinetics:grape")], {"hours": "'1e400' is not a number of hours"}),
        ([("hours", "-1"), ("under", "kinetics:grape")], {"hours": "hours = -1 h is outside of what was measured"}),
        ([("hours", "48"), ("under", "kinetics:plum")], {"under": "kinetics: Input should be"}),
        ([("hours", "48"), ("under", "kinetics:grape,kinetics:page")], {"under": "kinetics is given more than once"}),
        ([("hours", "48"), ("under", "kinetic:grape")], {"under": "unknown name 'kinetic'"}),
    ],
)
def test_the_parameter_that_has_to_change_is_named_with_what_to_change(
    client: httpx.Client, query: list[tuple[str, str]], wrong: dict[str, str]
) -> None:
    asked = [*POINT.items(), *query]
    problem = checked(client.get(SHAPE, params=asked), 422, "invalid-query")
    assert {item["name"] for item in problem["errors"]} == set(wrong)
    for item in problem["errors"]:
        assert item["detail"].startswith(wrong[item["name"]])
        assert item["advice"]
    assert ".." not in problem["detail"]
