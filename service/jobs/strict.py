"""Numbers in a job's JSON are numbers: a solver reads text as the command line types it, and true as 1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from solver.contract import Solver

from ..errors import InvalidQuery, Wrong

__all__ = ["check"]


def check(solver: Solver, params: Mapping[str, Any]) -> None:
    """Refuse text and truth values where a parameter is a number, or one of several.

    Raises:
        InvalidQuery: naming each of them.

    """
    wrong = [
        Wrong(f"params.{name}", f"{str(value)[:40]!r} is no number", "Write numbers without quotes, like 0.04.")
        for name, whole in params.items()
        if _is_number(solver, name)
        for value in _each(whole)
        if isinstance(value, bool | str)
    ]
    if wrong:
        raise InvalidQuery.of(wrong)


def _each(value: Any) -> Iterator[Any]:
    yield from value if isinstance(value, list) else (value,)


def _is_number(solver: Solver, name: str) -> bool:
    """Return whether a parameter is a number, an axis, or a field of several numbers, and nothing else."""
    if name in solver.params.axes:
        return True
    field = solver.params.model_fields.get(name)
    if field is None:
        return False
    if field.annotation in (int, float):
        return True
    usual = field.default
    is_several = isinstance(usual, tuple) and bool(usual)
    return is_several and all(isinstance(one, int | float) and not isinstance(one, bool) for one in usual)
