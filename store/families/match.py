"""Whether a table holds the fruit that is asked for, and if not, what differs and how far.

Two fruits are the same where all their parameters are, but for those that only say how a run is done (a solver's
`incidental` ones: seed, mirror planes): they count where they are named. Numbers are equal to 1e-9 of their size;
those that follow one of the table's axes (`ties`) to 2e-3, because between samples they follow a curve. The distance of
two numbers is the logarithm of their ratio, since ratios of lengths and of moduli are what matters, or their difference
where they are not both positive; anything else is 1 apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from ..canonical import canonical
from ..manifest import TableInfo

__all__ = ["STAGE", "TIED", "Fit", "Miss", "apart", "compare", "flat", "same"]

#: What a stage that is out of reach is called among misses.
STAGE = "stage"

_EQUAL = 1e-9
#: Share by which a number that follows an axis may be off.
TIED = 2e-3
#: Share of a range by which a number may lie outside: round-off of bounds that went through text.
_SLACK = 1e-9


class Miss(NamedTuple):
    """A parameter that a table does not hold: what was asked, what it holds nearest to that, its range if it has one,
    and how far they are apart.
    """

    name: str
    asked: Any
    held: Any
    reach: tuple[float, float] | None
    distance: float


class Fit(NamedTuple):
    """How a table fits a question: what it misses of what was said, what of the rest is not as usual, and axes that
    nobody gave a value.
    """

    info: TableInfo
    misses: tuple[Miss, ...]
    unusual: tuple[Miss, ...]
    missing: tuple[str, ...]

    @property
    def distance(self) -> float:
        """Distance of the question from the table, over all parameters."""
        return math.hypot(*(miss.distance for miss in (*self.misses, *self.unusual)))


def flat(values: Mapping[str, Any], places: Mapping[str, tuple[str, int | None]]) -> dict[str, Any]:
    """Return parameters by the names that tables use: scalars of whole fields by axis, or as field[index]."""
    axes: dict[str, dict[int | None, str]] = {}
    for axis, (field, index) in places.items():
        axes.setdefault(field, {})[index] = axis
    found: dict[str, Any] = {}
    for name, value in values.items():
        named = axes.get(name)
        if named is None or name in places:
            continue
        if None in named:
            found[named[None]] = value
        elif isinstance(value, list | tuple):
            found |= {named.get(i, f"{name}[{i}]"): entry for i, entry in enumerate(value)}
    # a scalar by its own name goes over the whole field
    return found | {name: value for name, value in values.items() if name in places or name not in axes}


def same(a: Any, b: Any, tolerance: float = _EQUAL) -> bool:
    """Return whether two values of a parameter are the same; nothing and an empty text are."""
    if _is_number(a) and _is_number(b):
        return math.isclose(a, b, rel_tol=tolerance, abs_tol=1e-12)
    return (a in ("", None) and b in ("", None)) or canonical(a) == canonical(b)


def apart(a: Any, b: Any) -> float:
    """Return the distance of two values of a parameter."""
    if not (_is_number(a) and _is_number(b)):
        return 0.0 if same(a, b) else 1.0
    # not of a / b, which is nothing or infinite where the numbers are far enough apart
    return abs(math.log(a) - math.log(b)) if a > 0 and b > 0 else abs(a - b)


def compare(
    info: TableInfo, values: Mapping[str, Any], names: Iterable[str], usual: Mapping[str, Any] | None = None
) -> list[Miss]:
    """Return what a table misses of the `names` among `values`, the stage among them.

    What a table says nothing of is as `usual`: parameters that came later, or are written only where they differ.
    """
    found = []
    for name in names:
        asked = values[name]
        reach = info.reach if name == STAGE else info.axes.get(name)
        if reach is not None:
            low, high = reach
            slack = _SLACK * (high - low)
            if not (_is_number(asked) and low - slack <= asked <= high + slack):
                held = min(max(asked, low), high) if _is_number(asked) else low
                found.append(Miss(name, asked, held, reach, apart(asked, held)))
            continue
        tie = info.tied.get(name)
        if tie is None:
            held, tolerance = info.fixed[name] if name in info.fixed else (usual or {}).get(name), _EQUAL
        else:
            lead = values.get(tie.leader)
            held, tolerance = tie(float(lead) if isinstance(lead, int | float) else tie.at[0]), TIED
        if not same(asked, held, tolerance):
            found.append(Miss(name, asked, held, None, apart(asked, held)))
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
