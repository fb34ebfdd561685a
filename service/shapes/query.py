"""A query string as numbers: every parameter checked against the table's words, every wrong one named."""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from solver.contract import Shade
from store.blending import methods
from store.errors import OutsideTable
from store.families.match import TIED, same
from store.families.ties import Tie
from store.surfaces.measures import Measures

from ..errors import InvalidQuery, Wrong
from ..formats import About
from . import detail

__all__ = [
    "EXACT",
    "LIMITS",
    "LOWEST_RESOLUTION",
    "RESERVED",
    "TIMES",
    "ShapeQuery",
    "Words",
    "method_of",
    "number_of",
    "parse",
]

#: Names that are not axes.
RESERVED = ("resolution", "table", "preset", "format", "method", "max_error", "exact", *detail.NAMES)
#: Names that stand in place of the stage.
TIMES = ("hours", "under")

#: What may be asked for beyond the table: a run of what it does not answer, or what it answers, relaxed.
EXACT = ("run", "relax")

#: Fewer colatitude samples hold no shape.
LOWEST_RESOLUTION = 4
#: How errors are limited: a number, or measure:number, several of them with commas between.
_LIMIT = rf"(?:(?:{'|'.join(Measures._fields)}):)?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?"
LIMITS = rf"{_LIMIT}(?:,{_LIMIT})*"

_RESOLUTION = re.compile(r"([0-9]{1,6})(?:[x×]([0-9]{1,6}))?")

#: Share of a range by which a number may lie outside: round-off of bounds that went through text.
_SLACK = 1e-9

Range = tuple[float, float]


class Words(NamedTuple):
    """What may be asked: axes and stage with their ranges and units, what the table holds fixed, numbers and `texts`,
    and numbers that follow one of its axes. `made` says how its runs were done, `shade` what its fruits wear.
    """

    axes: Mapping[str, Range]
    fixed: Mapping[str, float]
    stage: str
    stages: Range
    units: Mapping[str, str]
    max_resolution: int
    tied: Mapping[str, Tie] = {}
    made: Mapping[str, Any] = {}
    shade: Shade | None = None
    texts: Mapping[str, str] = {}

    @property
    def ranges(self) -> dict[str, Range]:
        """All that must be given, with its range."""
        return {**self.axes, self.stage: self.stages}

    def about(self, solver: str, table: str, **more: Any) -> About:
        """Return what files say of a shape of the table of that name: of every one, and with it what is said `more`."""
        every: dict[str, Any] = {"made": self.made, "shade": self.shade, "reach": self.stages}
        return About(solver, table, self.fixed, self.stage, self.units, **every, **more)

    def say(self, name: str) -> str:
        """Return the range of an axis or of the stage with its units, in words."""
        low, high = self.ranges[name]
        units = self.units.get(name, "1")
        return f"{low:.15g} to {high:.15g}" + ("" if units == "1" else f" [{units}]")


class ShapeQuery(NamedTuple):
    """One question: the point on the axes, the stage, and the resolution where one was named.

    `named` are fixed parameters that were given all the same, and `outside` what is off the table: then `point`,
    `stage` and `named` are a question to the solver, not to the table. `method` is spelt in one way. `max_error` limits
    errors by measure. `exact`: what the table cannot answer is to be `run`, or what it answers to be `relax`ed. `said`
    are the numbers and words that the asker named, and `is_elsewhere`: no table holds this fruit, whatever its skin and
    stage.
    """

    point: dict[str, float]
    stage: float
    resolution: int | None
    named: dict[str, float | str]
    outside: tuple[Wrong, ...] = ()
    method: str = methods.DEFAULT
    max_error: dict[str, float] | None = None
    exact: str = ""
    said: Mapping[str, float | str] = {}
    is_elsewhere: bool = False


def parse(
    items: Sequence[tuple[str, str]],
    words: Words,
    also: Sequence[Wrong] = (),
    filled: Mapping[str, Any] | None = None,
    beyond: Sequence[Wrong] = (),
    preset: str | None = None,
    reserved: Sequence[str] = (*RESERVED, *TIMES),
) -> ShapeQuery:
    """Return the question that the decoded `items` of a query string ask; it may lie outside the table.

    `also` is what is wrong besides, `beyond` how the table is not the one that is asked for. `filled` are the
    numbers of a `preset`, for what the asker does not say. `reserved` are the names that may be given besides.

    Raises:
        InvalidQuery: listing every name that is unknown, missing or repeated, and every value that cannot be used.

    """
    wrong, ranges = [*_repeated(items), *also], words.ranges
    outside: list[Wrong] = []
    numbers: dict[str, float] = {}
    texts: dict[str, str] = {}
    chosen: dict[str, Any] = {"resolution": None}
    given = dict(items)
    for name, text in given.items():
        if name in _READERS:
            found = _READERS[name](text, words)
            if isinstance(found, Wrong):
                wrong.append(found)
            else:
                chosen[name] = found
        elif name in ranges or name in words.fixed or name in words.tied:
            number = number_of(text)
            if number is None:
                wrong.append(Wrong(name, f"{text[:40]!r} is not a finite number", "Write it like 0.05."))
            else:
                numbers[name] = number
        elif name in words.texts:
            texts[name] = text
            outside += _other(name, text, words.texts[name])
        elif name not in RESERVED:
            wrong.append(_unknown(name, [*ranges, *words.tied, *words.fixed, *words.texts, *reserved]))
    said: dict[str, float | str] = {**numbers, **texts}
    if filled:
        known = {**ranges, **words.fixed, **words.tied}
        numbers = {**{name: value for name, value in filled.items() if name in known}, **numbers}
    for name, number in numbers.items():
        outside += _off(name, number, words, ranges, numbers)
    for name in ranges:
        if name not in numbers and name not in given:
            wrong.append(Wrong(name, "is missing", f"Add {name}= and a number from {words.say(name)}."))
    if chosen.get("exact") == "relax" and "max_error" in given:
        wrong.append(Wrong("max_error", "nobody knows the error of what is relaxed", "Leave it out."))
    if wrong:
        raise InvalidQuery.of([*wrong, *outside])
    outside = _together(outside, beyond, said, preset)
    point = {name: numbers[name] for name in words.axes}
    named = {name: value for name, value in said.items() if name not in ranges}
    chosen |= {"said": said, "is_elsewhere": any(w.name not in ranges for w in outside)}
    return ShapeQuery(point, numbers[words.stage], named=named, outside=tuple(outside), **chosen)


def _together(
    outside: Sequence[Wrong], beyond: Sequence[Wrong], said: Mapping[str, float | str], preset: str | None
) -> list[Wrong]:
    """Return what is off the table, each once; what only a preset said is not the asker's to leave out."""
    advice = {} if preset is None else {w.name: _of_preset(preset) for w in outside if w.name not in said}
    advice |= {w.name: w.advice for w in beyond}
    found = [w._replace(advice=advice.get(w.name, w.advice)) for w in outside]
    return [*found, *(w for w in beyond if w.name not in {w.name for w in found})]


def _of_preset(preset: str) -> str:
    return f"That is of the preset {preset}: choose another preset, or another table."


def _other(name: str, text: str, held: str) -> list[Wrong]:
    """Return what is wrong with a word that is not the one that the table holds, or nothing."""
    if text == held:
        return []
    detail = f"this table holds {name} = {held!r} only, not {text[:40]!r}"
    return [Wrong(name, detail, _set(name, held))]


def _set(name: str, held: str) -> str:
    """Return how to have what a table holds; to leave a parameter out would bring a preset's value back."""
    return f"{f'Set {name}={held}' if held else f'Leave {name} out'}, or choose another table."


def _unknown(name: str, known: Sequence[str]) -> Wrong:
    near = difflib.get_close_matches(name, known, n=1)
    advice = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}."
    return Wrong(name[:40], "is not a parameter of this table", advice)


def _off(
    name: str, number: float, words: Words, ranges: Mapping[str, Range], numbers: Mapping[str, float]
) -> list[Wrong]:
    """Return what is wrong with a number that the table does not reach, or nothing."""
    if name in words.tied:
        tie = words.tied[name]
        lead = numbers.get(tie.leader)
        held = None if lead is None else tie.beyond(lead)
        # where nobody knows what goes with the leader, that is off its axis, and the asker's word counts
        if lead is None or held is None or same(number, held, TIED):
            return []
        detail = f"{number:g} is not what goes with {tie.leader} = {lead:g} in this table, {held:.4g}"
        return [Wrong(name, detail, _set(name, f"{held:.6g}"))]
    if name in words.fixed:
        held = words.fixed[name]
        if math.isclose(number, held, rel_tol=_SLACK, abs_tol=1e-12):
            return []
        return [Wrong(name, f"this table holds {name} = {held:g} only", _set(name, f"{held:.15g}"))]
    low, high = ranges[name]
    slack = _SLACK * (high - low)
    if low - slack <= number <= high + slack:
        return []
    return [Wrong(name, f"{number:.9g} is off the table's {words.say(name)}", f"Take {name} from {words.say(name)}.")]


def _repeated(items: Sequence[tuple[str, str]]) -> list[Wrong]:
    if len({name for name, _ in items}) == len(items):
        return []
    counts = Counter(name for name, _ in items)
    return [Wrong(name[:40], "is given more than once", "Give it once.") for name, n in counts.items() if n > 1]


def number_of(text: str) -> float | None:
    """Return the finite number that a text is, None if it is none: in plain digits, not as programs write them. Of
    nothing there is no negative.
    """
    if "_" in text or not text.isascii():
        return None
    try:
        number = float(text)
    except ValueError:
        return None
    return number + 0.0 if math.isfinite(number) else None


def _resolution(text: str, words: Words) -> int | Wrong:
    """Return the colatitude samples that `64` or `64x128` name."""
    highest = words.max_resolution
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


def method_of(text: str) -> str | Wrong:
    """Return the one spelling of a method; a plus that came as a blank, as an unquoted one does, is one."""
    try:
        return str(methods.parse(text.replace(" ", "+")))
    except OutsideTable as error:
        return Wrong("method", f"{text[:40]!r} is not a method of look-up", error.advice)


def _max_error(text: str, words: Words) -> dict[str, float] | Wrong:
    """Return the limits that `0.05` (of the roughness) or `rgh:0.05,dB:1.5` set."""
    advice = f"Write it like 0.05, for the roughness, or dB:1.5; measures: {', '.join(Measures._fields)}."
    pairs = [part.rpartition(":") for part in text.split(",")]
    limits = {name or "rgh": float(value) for name, _, value in pairs} if re.fullmatch(LIMITS, text) else {}
    if not limits or not all(map(math.isfinite, limits.values())):
        return Wrong("max_error", f"{text[:40]!r} limits no error", advice)
    if len(limits) < len(pairs):
        return Wrong("max_error", f"{text[:40]!r} limits a measure twice", "Limit each measure once.")
    return limits


def _exact(text: str, words: Words) -> str | Wrong:
    if text not in EXACT:
        advice = f"Write {' or '.join(f'exact={word}' for word in EXACT)}, or leave it out."
        return Wrong("exact", f"{text[:40]!r} is not {' or '.join(EXACT)}", advice)
    return text


_READERS: Mapping[str, Callable[[str, Words], Any]] = {
    "resolution": _resolution,
    "method": lambda text, words: method_of(text),
    "max_error": _max_error,
    "exact": _exact,
}
