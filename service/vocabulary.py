"""A solver's words for the outside: its query axes with units, bounds and meaning, read off its parameter schema."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from solver import registry
from solver.contract import InvalidInput, Solver

from .errors import InvalidQuery, UnknownSolver, Wrong

__all__ = ["Axis", "axes", "row_of", "solver_named"]


class Axis(NamedTuple):
    """One scalar that may be asked for: what it is, its units, and the bounds of what the solver accepts."""

    name: str
    description: str
    units: str
    lowest: float | None
    highest: float | None
    default: float | None


def solver_named(name: str) -> Solver:
    """Return the solver called `name`.

    Raises:
        UnknownSolver: there is none of that name.

    """
    try:
        return registry.get(name)
    except InvalidInput as error:
        raise UnknownSolver(error.message, advice=error.advice) from None


@cache
def axes(solver_name: str) -> Mapping[str, Axis]:
    """Return the solver's query axes by name."""
    solver = solver_named(solver_name)
    fields: dict[str, Any] = solver.params.model_json_schema()["properties"]
    found = {}
    for name, (field, index) in solver.params.axes.items():
        whole = fields[field]
        item = whole if index is None else whole["prefixItems"][index]
        default = whole.get("default")
        if index is not None and default is not None:
            default = default[index]
        found[name] = Axis(
            name,
            whole.get("description", ""),
            whole.get("units", "1"),
            item.get("minimum"),
            item.get("maximum"),
            default,
        )
    return found


def row_of(stages: Sequence[float], stage: float, of: str = "result") -> int:
    """Return which of a run's `stages` is the one that was asked for.

    Raises:
        InvalidQuery: none is; of: what the run is called.

    """
    near = min(range(len(stages)), key=lambda i: abs(stages[i] - stage))
    # no nearness of nan and of infinite stages is more than a number
    if not math.isclose(stages[near], stage, rel_tol=1e-9, abs_tol=1e-9):
        # of so many digits that what is advised is found
        advice = f"Take one of {', '.join(f'{s:.12g}' for s in stages)}."
        raise InvalidQuery.of([Wrong("stage", f"the {of} has no stage {stage:.12g}", advice)])
    return near
