"""Hours in place of a stage: `hours=48&under=kinetics:grape`, by the solver's own clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from pydantic import BaseModel, Field

from solver.contract import InvalidInput, Solver

from . import problems, vocabulary
from .errors import InvalidQuery, Wrong
from .shapes.query import TIMES, number_of

__all__ = ["UNDER", "router", "timed"]

router = APIRouter(tags=["catalogue"])

#: How conditions are written.
UNDER = "[a-z_]+:[A-Za-z0-9.+-]+(,[a-z_]+:[A-Za-z0-9.+-]+)*"
#: What to do where a name is given twice.
_ONCE = {"hours": "Give it once: each answer is of one stage.", "under": "Write conditions with commas between."}
_HOUR = r"[0-9]+(\.[0-9]+)?(e-?[0-9]+)?"


class Stages(BaseModel):
    """Where on a solver's stage axis hours of drying lead."""

    hours: list[float] = Field(description="Hours, as asked")
    stages: list[float] = Field(description="Stages after them")
    symbol: str = Field(description="The stage axis")
    under: dict[str, str] = Field(description="Conditions, as asked")
    conditions: dict[str, Any] = Field(description="All conditions that may be set, with units and meaning")


@router.get("/v1/solvers/{name}/stages", summary="Stages after hours", responses=problems.responses(404, 422))
def stages(
    name: Annotated[str, Path(description="Name of a solver; GET /v1/solvers lists them")],
    hours: Annotated[
        str,
        Query(
            max_length=2000,
            description="Hours, with commas between",
            examples=["24,48"],
            json_schema_extra={"pattern": f"^{_HOUR}(,{_HOUR})*$"},
        ),
    ],
    under: Annotated[
        str,
        Query(
            max_length=2000,
            description="Conditions as name:value, with commas between",
            examples=["temperature:60,air_speed:1,diameter:22"],
            json_schema_extra={"pattern": f"^({UNDER})?$"},
        ),
    ] = "",
    preset: Annotated[str | None, Query(description="Named parameters whose fruit dries")] = None,
) -> Stages:
    """Turn hours of drying into stages, for presets and conditions that were measured; others are refused by name."""
    solver = vocabulary.solver_named(name)
    asked, conditions = _hours(hours), _conditions(under)
    return Stages(
        hours=asked,
        stages=list(_after(solver, asked, conditions, preset)),
        symbol=solver.stages.symbol,
        under=conditions,
        conditions=solver.clock.conditions.model_json_schema()["properties"] if solver.clock else {},
    )


def timed(items: Sequence[tuple[str, str]], solver: Solver, preset: str | None = None) -> list[tuple[str, str]]:
    """Return the items of a query with the stage in place of hours and conditions.

    Raises:
        InvalidQuery: no hours, several of them, the stage beside them, or conditions that nobody measured.

    """
    said = [(name, value) for name, value in items if name in TIMES]
    kept = [(name, value) for name, value in items if name not in TIMES]
    if not said:
        return kept
    given, symbol = dict(said), solver.stages.symbol
    wrong = [Wrong(name, "is given more than once", _ONCE[name]) for name in given if _is_twice(name, said)]
    hours = number_of(given.get("hours", ""))
    beside = any(name == symbol for name, _ in kept)
    if "hours" in given and beside:
        wrong.append(Wrong("hours", f"stands beside {symbol}", f"Keep one of hours and {symbol}."))
    elif beside:
        advice = f"Give hours= in place of {symbol}, or leave under out."
        wrong.append(Wrong("under", "says how hours are spent, and there are none", advice))
    elif hours is None:
        detail = _no_hours(given["hours"]) if "hours" in given else "is missing"
        wrong.append(Wrong("hours", detail, "Write it like hours=48."))
    if wrong or hours is None:
        raise InvalidQuery.of(wrong)
    under = _conditions(given.get("under", ""))
    try:
        (stage,) = _after(solver, [hours], under, preset)
    except InvalidInput as error:
        name, advice = _blamed(solver, under, preset), error.advice or "Write it like under=temperature:60."
        raise InvalidQuery.of([Wrong(name, error.message.rstrip("."), advice)]) from None
    return [*kept, (symbol, repr(stage))]


def _hours(text: str) -> list[float]:
    """Return the hours in a text with commas between.

    Raises:
        InvalidQuery: naming each that is no number.

    """
    parts = {part: number_of(part) for part in text.split(",")}
    wrong = [Wrong("hours", _no_hours(part), "Write it like hours=24,48.") for part in parts if parts[part] is None]
    if wrong:
        raise InvalidQuery.of(wrong)
    return [found for part in text.split(",") if (found := parts[part]) is not None]


def _no_hours(text: str) -> str:
    return f"{text[:40]!r} is not a number of hours"


def _after(solver: Solver, hours: Sequence[float], under: Mapping[str, str], preset: str | None) -> tuple[float, ...]:
    """Return the stages after hours; what advice says of conditions is written as a query has them."""
    try:
        return solver.stages_after(hours, under, preset)
    except InvalidInput as error:
        raise InvalidInput(error.message, advice=solver.conditions_as(error.advice, _written)) from None


def _written(conditions: Mapping[str, str]) -> str:
    return "under=" + ",".join(f"{name}:{value}" for name, value in conditions.items())


def _is_twice(name: str, items: Sequence[tuple[str, str]]) -> bool:
    return sum(name == other for other, _ in items) > 1


def _blamed(solver: Solver, under: Mapping[str, str], preset: str | None) -> str:
    """Return which parameter to change: the hours, where those conditions know a stage after none of them."""
    try:
        solver.stages_after([0.0], under, preset)
    except InvalidInput:
        return "under" if solver.clock else "hours"
    return "hours"


def _conditions(text: str) -> dict[str, str]:
    """Return conditions by name; numbers stay text, which their model reads.

    Raises:
        InvalidQuery: one is named twice.

    """
    pairs = [part.partition(":")[::2] for part in text.split(",") if part]
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(name for name in found if sum(name == other for other, _ in pairs) > 1)
        raise InvalidQuery.of([Wrong("under", f"{twice[:40]} is given more than once", "Give it once.")])
    return found
