"""Checks what is asked of a table before any work, and says how to ask for something that it can answer."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import OutsideTable
from ..families.match import compare, same
from ..manifest import TableInfo

__all__ = ["check_names", "check_number", "settle", "settle_stage"]

#: Share of an axis' range by which a query may lie outside: round-off of bounds that went through text.
_SLACK = 1e-9


def settle(table: TableInfo, query: Mapping[str, Any]) -> dict[str, float]:
    """Return the query's value on every varying axis, in the table's order. What the table holds fixed, numbers and
    others, may be said as it is.

    Raises:
        OutsideTable: a missing or unknown name, a value that is not finite, off its axis, or against what is fixed.

    """
    known = [*table.axes, *table.tied, *table.fixed]
    check_names("parameter", query, known)
    missing = [name for name in table.axes if name not in query]
    if missing:
        raise OutsideTable(f"{', '.join(missing)} must be given.", describe(table))
    for name in query:
        if name in table.fixed:
            _check_fixed(name, query[name], table.fixed[name])
    found = {name: _inside(name, query[name], *bounds, table) for name, bounds in table.axes.items()}
    for miss in compare(table, {**query, **found}, [name for name in query if name in table.tied]):
        lead = table.tied[miss.name].leader
        raise OutsideTable(
            f"{miss.name} = {miss.asked} is not in the table.",
            f"It goes with {lead}: {miss.held:.4g} where {lead} = {found[lead]:g}. Leave it out.",
        )
    return found


def settle_stage(table: TableInfo, stage: float) -> float:
    """Return the stage, between the first and the last of the stored ones and the fresh 0.

    Raises:
        OutsideTable: it is not.

    """
    return _inside("stage", stage, *table.reach, table)


def describe(table: TableInfo) -> str:
    """Return a sentence with all axes and their bounds."""
    axes = [f"{name} {low:g} to {high:g}" for name, (low, high) in table.axes.items()]
    low, high = table.reach
    return f"The table holds {', '.join([*axes, f'stage {low:g} to {high:g}'])}."


def check_names(kind: str, names: Iterable[str], known: list[str]) -> None:
    """Refuse unknown names.

    Raises:
        OutsideTable: with the nearest known name.

    """
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise OutsideTable(f"the table has no {kind} {name!r}.", f"{hint}Known: {', '.join(known)}.")


def check_number(name: str, value: Any) -> float:
    """Return a finite number.

    Raises:
        OutsideTable: it is not one.

    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise OutsideTable(f"{name} = {value} is not a finite number.", "Give a number.")
    return number


def _inside(name: str, value: Any, low: float, high: float, table: TableInfo) -> float:
    number = check_number(name, value)
    slack = _SLACK * (high - low)
    if not low - slack <= number <= high + slack:
        raise OutsideTable(
            f"{name} = {number:g} lies outside the table's {low:g} to {high:g}.",
            f"Stay within it, or run a sweep there. {describe(table)}",
        )
    return min(max(number, low), high)


def _check_fixed(name: str, value: Any, fixed: Any) -> None:
    if isinstance(fixed, int | float) and not isinstance(fixed, bool):
        value, held = check_number(name, value), f"{fixed:g}"
    else:
        held = str(fixed)
    if not same(value, fixed):
        raise OutsideTable(f"{name} = {value} is not in the table.", f"{name} is {held} in the whole table.")
