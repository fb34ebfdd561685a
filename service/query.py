"""A query string as numbers: every parameter checked against the table's words, every wrong one named."""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from . import detail
from .errors import InvalidQuery, OutsideRanges, Wrong

__all__ = ["LOWEST_RESOLUTION", "RESERVED", "ShapeQuery", "Words", "parse"]

#: Names that are not axes.
RESERVED = ("resolution", "table", "format", *detail.NAMES)

#: Fewer colatitude samples hold no shape.
LOWEST_RESOLUTION = 4
_RESOLUTION = re.compile(r"(\d{1,6})(?:[x×](\d{1,6}))?")

#: Share of a range by which a number may lie outside: round-off of bounds that went through text.
_SLACK = 1e-9

Range = tuple[float, float]


class Words(NamedTuple):
    """What may be asked: axes and stage with their ranges and units, and the numbers that the table holds fixed."""

    axes: Mapping[str, Range]
    fixed: Mapping[str, float]
    stage: str
    stages: Range
    units: Mapping[str, str]
    max_resolution: int

    @property
    def ranges(self) -> dict[str, Range]:
        """All that must be given, with its range."""
        return {**self.axes, self.stage: self.stages}

    def say(self, name: str) -> str:
        """Return the range of an axis or of the stage with its units, in words."""
        low, high = self.ranges[name]
        units = self.units.get(name, "1")
        return f"{low:g} to {high:g}" + ("" if units == "1" else f" [{units}]")


class ShapeQuery(NamedTuple):
    """One question: the point on the axes, the stage, and the resolution where one was named."""

    point: dict[str, float]
    stage: float
    resolution: int | None


def parse(items: Sequence[tuple[str, str]], words: Words, also: Sequence[Wrong] = ()) -> ShapeQuery:
    """Return the question that the decoded `items` of a query string ask. `also` is what is wrong besides.

    Raises:
        OutsideRanges: listing every number off its axis, where nothing else is wrong.
        InvalidQuery: listing every name that is unknown, missing or repeated, and every value that cannot be used.

    """
    wrong = [*_repeated(items), *also]
    outside: list[Wrong] = []
    numbers: dict[str, float] = {}
    resolution: int | None = None
    given = dict(items)
    for name, text in given.items():
        if name == "resolution":
            found = _resolution(text, words.max_resolution)
            if isinstance(found, Wrong):
                wrong.append(found)
            else:
                resolution = found
        elif name in words.ranges or name in words.fixed:
            number = _number(text)
            if number is None:
                wrong.append(Wrong(name, f"{text[:40]!r} is not a finite number", "Write it like 0.05."))
            else:
                numbers[name] = number
                outside += _off(name, number, words)
        elif name not in RESERVED:
            wrong.append(_unknown(name, [*words.ranges, *words.fixed, *RESERVED]))
    for name in words.ranges:
        if name not in given:
            wrong.append(Wrong(name, "is missing", f"Add {name}= and a number from {words.say(name)}."))
    if wrong:
        raise InvalidQuery.of([*wrong, *outside])
    if outside:
        raise OutsideRanges.of(outside)
    return ShapeQuery({name: numbers[name] for name in words.axes}, numbers[words.stage], resolution)


def _unknown(name: str, known: Sequence[str]) -> Wrong:
    near = difflib.get_close_matches(name, known, n=1)
    advice = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}."
    return Wrong(name[:40], "is not a parameter of this table", advice)


def _off(name: str, number: float, words: Words) -> list[Wrong]:
    """Return what is wrong with a number that the table does not reach, or nothing."""
    if name in words.fixed:
        held = words.fixed[name]
        if math.isclose(number, held, rel_tol=_SLACK, abs_tol=1e-12):
            return []
        return [Wrong(name, f"this table holds {name} = {held:g} only", f"Leave {name} out, or choose another table.")]
    low, high = words.ranges[name]
    slack = _SLACK * (high - low)
    if low - slack <= number <= high + slack:
        return []
    return [Wrong(name, f"{number:g} is off the table's {words.say(name)}", f"Take {name} from {words.say(name)}.")]


def _repeated(items: Sequence[tuple[str, str]]) -> list[Wrong]:
    counts = Counter(name for name, _ in items)
    return [Wrong(name[:40], "is given more than once", "Give it once.") for name, n in counts.items() if n > 1]


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _resolution(text: str, highest: int) -> int | Wrong:
    """Return the colatitude samples that `64` or `64x128` name."""
    match = _RESOLUTION.fullmatch(text.strip().lower())
    if match is None:
        return Wrong("resolution", f"{text[:40]!r} is not a resolution", "Write it like 64 or 64x128.")
    rows, columns = int(match[1]), match[2]
    if columns is not None and int(columns) != 2 * rows:
        advice = f"Ask for {rows} or {rows}x{2 * rows}."
        return Wrong("resolution", f"{text[:40]}: azimuth has twice as many samples as colatitude", advice)
    if not LOWEST_RESOLUTION <= rows <= highest:
        return Wrong(
            "resolution",
            f"{rows} colatitude samples are not between {LOWEST_RESOLUTION} and {highest}",
            f"Ask for {LOWEST_RESOLUTION} to {highest}; an operator raises the limit with WIZEN_MAX_RESOLUTION.",
        )
    return rows
