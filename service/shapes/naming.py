"""Names in a query beyond those of a table's axes: whole fields of a solver's parameters, and those that are words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from solver.contract import Params, Solver

from ..errors import InvalidQuery, Wrong
from .query import RESERVED, number_of

__all__ = ["named", "said", "words"]

#: What to do about a parameter that no query can say.
_RUN = "Have it run: POST /v1/jobs."


def named(items: Sequence[tuple[str, str]], solver: Solver) -> list[tuple[str, str]]:
    """Return the items of a query by the names that tables use: `stone=0.4,0.4` as its entries, `exocarp_thickness` as
    `te`.

    Raises:
        InvalidQuery: a field that is neither, or one with more, fewer or other entries than tables hold.

    """
    whole = _whole(solver.params)
    if whole.keys().isdisjoint(name for name, _ in items):
        return list(items)
    found: list[tuple[str, str]] = []
    wrong: list[Wrong] = []
    for name, text in items:
        axes = whole.get(name)
        if axes is None:
            found.append((name, text))
        elif None in axes:
            found.append((axes[None], text))
        else:
            found += _entries(name, text, axes, solver.params.model_fields[name].default, wrong)
    if wrong:
        raise InvalidQuery.of(wrong)
    return found


def said(items: Sequence[tuple[str, str]], solver: Solver) -> dict[str, float | str]:
    """Return the numbers that are said by their names, and the words of those parameters that are such."""
    texts = words(solver.params)
    found: dict[str, float | str] = {}
    for name, text in items:
        if name in RESERVED:
            continue
        number = number_of(text)
        if name in texts:
            found[name] = text
        elif number is not None:
            found[name] = number
    return found


@lru_cache(maxsize=32)
def words(params: type[Params]) -> Mapping[str, str]:
    """Return the parameters that are words, with their defaults."""
    return {name: field.default for name, field in params.model_fields.items() if isinstance(field.default, str)}


@lru_cache(maxsize=32)
def _whole(params: type[Params]) -> Mapping[str, Mapping[int | None, str]]:
    """Return the fields that are asked for by other names than their own, with the axes of their entries."""
    found: dict[str, dict[int | None, str]] = {
        name: {}
        for name, field in params.model_fields.items()
        if name not in RESERVED and not isinstance(field.default, int | float | str)
    }
    for axis, (field, index) in params.axes.items():
        if axis != field and field not in RESERVED:
            found.setdefault(field, {})[index] = axis
    return {name: axes for name, axes in found.items() if name not in params.axes}


def _entries(
    name: str, text: str, axes: Mapping[int | None, str], usual: Any, wrong: list[Wrong]
) -> list[tuple[str, str]]:
    """Return the entries of a field as items; what is wrong with it goes into `wrong`."""
    if not axes or not isinstance(usual, list | tuple):
        wrong.append(Wrong(name, "is of runs alone: no table is asked by it", _RUN))
        return []
    parts = text.strip().removeprefix("[").removesuffix("]").split(",")
    if len(parts) != len(usual):
        example = ",".join(f"{number:g}" for number in usual)
        detail = f"{text[:40]!r} is not {len(usual)} numbers with commas between"
        wrong.append(Wrong(name, detail, f"Write it like {name}={example}, or say {' and '.join(axes.values())}."))
        return []
    for i, part in enumerate(parts):
        if i not in axes and number_of(part) != usual[i]:
            detail = f"tables hold {usual[i]:g} in place {i + 1} only, not {part[:40]!r}"
            wrong.append(Wrong(name, detail, f"Write {usual[i]:g} there. {_RUN}"))
    return [(axes[i], part) for i, part in enumerate(parts) if i in axes]
