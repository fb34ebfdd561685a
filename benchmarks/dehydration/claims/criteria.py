"""What decides the statements C1 to C6 of Liu et al. 2014, section 4: one criterion for each clause, each able to fail.

A trend is the slope of a straight line through all samples of a row, seeds among them, times the row's length; of
positive measures it is that of their logarithm. Its uncertainty comes from what another seed changes: the scatter of
seeds about their means, pooled over all fruits of all plans. A clause holds where it does by more than twice the
standard error, fails where it fails by as much, and is unclear between. Without two seeds nothing is judged.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from .pattern import Pattern

__all__ = ["CLEAR", "Found", "judge"]

#: A measure rises, or falls, if it changes at least by this share along the row.
CLEAR = 0.10
#: Ridged above, reticular below: the share of slopes across meridians less that along them, at the equator.
RIDGED = 0.3
#: Wrinkles are local to the thick flesh if they are at least that many times as high there.
LOCAL = 1.5
#: Standard errors that make a difference.
SURE = 2.0
#: Of so many places a row consists, at least.
POINTS = 2


class Found(NamedTuple):
    """One clause of a statement in one row of samples: what was measured, and whether it holds."""

    claim: str
    clause: str
    row: str
    measured: str
    verdict: str


class Value(NamedTuple):
    """A measured value and its standard error."""

    value: float
    error: float

    def __str__(self) -> str:
        return f"{self.value:+.2f} +- {self.error:.2f}" if np.isfinite(self.error) else f"{self.value:+.2f}"

    def above(self, bound: float) -> str:
        """Return whether it lies above the bound, as a verdict."""
        if not np.isfinite(self.error):
            return "not judged: one seed only"
        away = (self.value - bound) / max(self.error, 1e-12)
        return "holds" if away > SURE else "fails" if away < -SURE else "unclear"

    def below(self, bound: float) -> str:
        """Return whether it lies below the bound, as a verdict."""
        return Value(-self.value, self.error).above(-bound)


Measure = Callable[[Pattern], float]
#: What another seed changes of a measure.
Spread = Callable[[Measure], float]


def judge(plans: Mapping[str, Sequence[Pattern]]) -> list[Found]:
    """Return what becomes of every clause, given the samples of the plans fig7, fig8, fig9, fig10 and table1.

    What a plan has too few samples of is "not judged", with the reason.
    """
    every = tuple(dict.fromkeys(itertools.chain.from_iterable(plans.values())))
    found: list[Found] = []
    for name, decide in _DECIDE.items():
        found += decide(list(plans.get(name, ())), partial(scatter, every))
    return found


def scatter(samples: Sequence[Pattern], measure: Measure) -> float:
    """Return the standard deviation that another seed causes, pooled over all fruits; infinite without two seeds."""
    groups: dict[tuple[object, ...], list[float]] = {}
    for sample in samples:
        groups.setdefault(_fruit(sample), []).append(measure(sample))
    free = sum(len(values) - 1 for values in groups.values())
    if free < 1:
        return np.inf
    return float(np.sqrt(sum(np.var(values) * len(values) for values in groups.values()) / free))


def _fruit(sample: Pattern) -> tuple[object, ...]:
    return sample.name, sample.te, sample.gamma, sample.stone, sample.waist


def _log(measure: Measure) -> Measure:
    return lambda sample: float(np.log(measure(sample)))


def _rows(samples: Sequence[Pattern], by: Measure, along: Measure) -> dict[float, list[Pattern]]:
    rows: dict[float, list[Pattern]] = {}
    for sample in sorted(samples, key=along):
        rows.setdefault(by(sample), []).append(sample)
    return {value: row for value, row in sorted(rows.items()) if len({along(s) for s in row}) >= POINTS}


def trend(row: Sequence[Pattern], along: Measure, measure: Measure, spread: float) -> Value:
    """Return by how much the measure changes along a row, of samples that each scatter by `spread`."""
    x, y = np.array([along(s) for s in row]), np.array([measure(s) for s in row])
    slope = float(np.polyfit(x, y, 1)[0])
    error = spread / float(np.sqrt(((x - x.mean()) ** 2).sum()))
    return Value(slope * float(np.ptp(x)), error * float(np.ptp(x)))


def _mean(samples: Sequence[Pattern], measure: Measure, spread: Spread) -> Value:
    return Value(float(np.mean([measure(s) for s in samples])), spread(measure) / len(samples) ** 0.5)


def _means(row: Sequence[Pattern], along: Measure, measure: Measure) -> str:
    groups: dict[float, list[float]] = {}
    for sample in row:
        groups.setdefault(along(sample), []).append(measure(sample))
    return " ".join(f"{np.mean(values):.3g}" for _, values in sorted(groups.items()))


def _share(change: Value) -> str:
    factor, error = np.exp(change.value) - 1, np.exp(change.value) * change.error
    return f"{100 * factor:+.0f} +- {100 * error:.0f} %" if np.isfinite(error) else f"{100 * factor:+.0f} %"


def _too_few(claim: str, clause: str) -> Found:
    return Found(claim, clause, "", "", "not judged: fewer than two samples of a row were run")


def _changes(
    claim: str, clause: str, samples: Sequence[Pattern], by: str, along: str, measure: str, rises: bool, spread: Spread
) -> list[Found]:
    """A positive measure that rises, or falls, along every row."""
    key, place, of = _of(by), _of(along), _of(measure)
    found = []
    for value, row in _rows(samples, key, place).items():
        change = trend(row, place, _log(of), spread(_log(of)))
        verdict = change.above(np.log1p(CLEAR)) if rises else change.below(-np.log1p(CLEAR))
        said = f"{measure.replace('_', ' ')} {_means(row, place, of)} ({_share(change)})"
        found.append(Found(claim, clause, f"{by} {value:g}, {along} {_ends(row, place)}", said, verdict))
    return found or [_too_few(claim, clause)]


def _ends(row: Sequence[Pattern], along: Measure) -> str:
    return f"{along(row[0]):g} to {along(row[-1]):g}"


_NAMED: dict[str, Measure] = {"stone": lambda s: s.stone[0], "r4": lambda s: s.waist}


def _of(name: str) -> Measure:
    return _NAMED.get(name) or (lambda sample: float(getattr(sample, name)))


def _more_for_thin(
    claim: str, clause: str, samples: Sequence[Pattern], measure: str, rises: bool, spread: Spread
) -> list[Found]:
    """A trend along the stone that is stronger for the thinnest skin than for the thickest."""
    place, of = _of("stone"), _log(_of(measure))
    rows = _rows(samples, _of("te"), place)
    if len(rows) < POINTS:
        return [_too_few(claim, clause)]
    sign = 1 if rises else -1
    thin, thick = (trend(rows[te], place, of, spread(of)) for te in (min(rows), max(rows)))
    gap = Value(sign * (thin.value - thick.value), float(np.hypot(thin.error, thick.error)))
    said = f"{_share(thin)} at te {min(rows):g}, {_share(thick)} at te {max(rows):g}"
    return [Found(claim, clause, f"te {min(rows):g} and {max(rows):g}", said, gap.above(0.0))]


def _fig7(samples: list[Pattern], spread: Spread) -> list[Found]:
    return [
        *_changes("C1", "fewer buckles with thicker skin", samples, "gamma", "te", "buckles", False, spread),
        *_changes("C1", "larger buckles with thicker skin", samples, "gamma", "te", "wavelength", True, spread),
        *_changes("C2", "larger buckles with stiffer skin", samples, "te", "gamma", "wavelength", True, spread),
    ]


def _fig8(samples: list[Pattern], spread: Spread) -> list[Found]:
    return [
        *_changes("C3", "strips with a larger stone", samples, "te", "stone", "elongation", True, spread),
        *_more_for_thin("C3", "most so for thin skin", samples, "elongation", True, spread),
    ]


def _fig9(samples: list[Pattern], spread: Spread) -> list[Found]:
    return [
        *_changes(
            "C4", "poles shallower with a longer stone", samples, "te", "stone", "poles_to_equator", False, spread
        ),
        *_more_for_thin("C4", "less so for thick skin", samples, "poles_to_equator", False, spread),
    ]


def _fig10(samples: list[Pattern], spread: Spread) -> list[Found]:
    anisotropy, place, found = _of("equator_anisotropy"), _of("r4"), []
    for te, row in _rows(samples, _of("te"), place).items():
        ends = {}
        for end in (place(row[0]), place(row[-1])):
            ends[end] = _mean([s for s in row if place(s) == end], anisotropy, spread)
        slim, round_ = min(ends), max(ends)
        along = trend(row, place, anisotropy, spread(anisotropy))
        for clause, where, value, verdict in (
            ("ridges round the equator of slender fruits", f"r4 {slim:g}", ends[slim], ends[slim].above(RIDGED)),
            ("stronger the slenderer", f"r4 {_ends(row, place)}", along, along.below(-CLEAR)),
            ("reticular near the sphere", f"r4 {round_:g}", ends[round_], ends[round_].below(RIDGED)),
        ):
            said = f"anisotropy {value}"
            found.append(Found("C5", clause, f"te {te:g}, {where}", said, verdict))
    return found or [_too_few("C5", "ridges along meridians of slender fruits")]


_SAID = {"jujube1": True, "raisin": True, "wolfberry": True, "jujube2": False, "plum2": False}


def _table1(samples: list[Pattern], spread: Spread) -> list[Found]:
    found = []
    for name in (*_SAID, "plum1"):
        own = [sample for sample in samples if sample.name == name]
        clause = f"{name}: wrinkled where the flesh is thick" if name == "plum1" else ""
        clause = clause or f"{name}: {'ridged' if _SAID[name] else 'reticular'}"
        if not own:
            found.append(Found("C6", clause, "", "", "not judged: not run, its skin is too thin to be cheap"))
            continue
        if name == "plum1":
            higher = _mean(own, _log(_of("thick_to_thin")), spread)
            verdict, said = higher.above(np.log(LOCAL)), f"higher there by {_share(higher)}"
        else:
            there = _mean(own, _of("equator_anisotropy"), spread)
            verdict = there.above(RIDGED) if _SAID[name] else there.below(RIDGED)
            said = f"anisotropy {there}"
        found.append(Found("C6", clause, f"te {own[0].te:g}", said, verdict))
    return found


_DECIDE: dict[str, Callable[[list[Pattern], Spread], list[Found]]] = {
    "fig7": _fig7,
    "fig8": _fig8,
    "fig9": _fig9,
    "fig10": _fig10,
    "table1": _table1,
}
