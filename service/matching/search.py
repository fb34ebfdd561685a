"""Where in the tables a target comes nearest: a look at every run, then the best ones followed downhill.

Distances are root mean squares of differences over their scatter: at 1 a shape is as near as one that wrinkled from
another seed. What the differences say of parameters and stage, to first order, is how sure each of them is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from solver.arrays import Floats
from store.errors import OutsideTable
from store.lookup import ShapeTable

from .targets import Look, Target

__all__ = ["Candidate", "Found", "Range", "search"]

#: Followed downhill: the nearest shapes of this many tables, and so many more of the nearest table.
_TABLES, _SECOND = 4, 7
#: Shapes between the runs of the nearest tables that are looked at too, and by how much of their range as many of them
#: are apart: distances have hollows there which no run lies in.
_BETWEEN, _APART = 256, 0.1
#: So many of them tell which of the tables is the nearest; their stages are around those of so many of its runs.
_FIRST, _BEST = 64, 8
#: So many tables at most, if their nearest run is no more than this many times as far as the nearest of all.
_CONTENDERS, _LIKELY = 3, 2.0
#: Found as near as this, no further start is followed: what is matched lies in the table itself.
_EXACT = 0.08
#: Tables whose nearest run is this many times as far as the nearest of all are not followed.
_HOPELESS = 6.0
#: Most shapes of one way downhill, by dimension; the step of differences, of a range.
_STEPS, _STEP = 14, 0.01
#: Shapes looked at of a table at a time, with what they are like.
_Seen = dict[tuple[object, ...], Look]
#: What tables' runs are like, kept while the tables are open: by kind of target and whether sizes count.
_kept: WeakKeyDictionary[ShapeTable, _Seen] = WeakKeyDictionary()

Progress = Callable[[float, str], None]
#: How far a shape is, and where: the range, the point and the stage.
_Row = tuple[float, "Range", dict[str, float], float]


class Range(NamedTuple):
    """What is searched of a table: the free axes and the stage with their bounds, and what is held."""

    table: ShapeTable
    free: dict[str, tuple[float, float]]
    held: dict[str, float]
    stage: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A shape of a table: where, how far from the target, by part too, and the standard deviations of its place."""

    table: ShapeTable
    point: dict[str, float]
    stage: float
    distance: float
    parts: dict[str, float]
    deviation: dict[str, float]
    edges: tuple[str, ...]


class Found(NamedTuple):
    """Candidates, the nearest first, and how many shapes were looked at."""

    candidates: list[Candidate]
    looked: int


def search(target: Target, ranges: Sequence[Range], progress: Progress = lambda share, what: None) -> Found:
    """Return the candidates of all ranges.

    Raises:
        OutsideTable: there is nothing to be compared in any of them.

    """
    rows: list[_Row] = []
    looked = 0
    for k, one in enumerate(ranges):
        progress(0.6 * k / len(ranges), f"table {one.table.info.name}")
        for point, stage in _places(one):
            look = _first_look(target, one, point, stage)
            looked += 1
            away = _distance(target.seen(True), look)
            if np.isfinite(away):
                rows.append((away, one, point, stage))
    if not rows:
        raise OutsideTable("no table holds what is to be compared.", "Name descriptors that tables have.")
    rows.sort(key=lambda row: row[0])
    runs = len(rows)
    contenders = _contenders(rows)
    for one in contenders:
        progress(0.5, f"between the runs of table {one.table.info.name}")
        rows += _between(target, one, rows, 0, _FIRST)
    rows.sort(key=lambda row: row[0])
    nearest = rows[0][1]
    progress(0.55, f"between the runs of table {nearest.table.info.name}")
    rows = sorted(rows + _between(target, nearest, rows, _FIRST, _BETWEEN), key=lambda row: row[0])
    looked += len(rows) - runs
    starts = _starts(rows, nearest)
    candidates: list[Candidate] = []
    for k, (_, one, point, stage) in enumerate(starts):
        progress(0.6 + 0.4 * k / len(starts), f"following table {one.table.info.name}")
        if candidates and one is nearest and min(found.distance for found in candidates) < _EXACT:
            continue
        walk = _Walk(target, one)
        candidates.append(walk.down(point, stage))
        looked += walk.looked
    candidates.sort(key=lambda found: found.distance)
    return Found(_distinct(candidates), looked)


def _contenders(rows: Sequence[_Row]) -> list[Range]:
    """Return the tables between whose runs something nearer may lie than any run is."""
    found: list[Range] = []
    for away, one, _, _ in rows:
        if away > _LIKELY * rows[0][0] or len(found) == _CONTENDERS:
            break
        if one not in found:
            found.append(one)
    return found


def _places(one: Range) -> list[tuple[dict[str, float], float]]:
    """Return the runs of a table within the range, at its knots; the held numbers and the bounds of stages besides."""
    info = one.table.info
    points = {tuple(sorted(_within(one, one.table.sample(i)).items())) for i in range(one.table.size)}
    low, high = one.stage
    stages = {min(max(stage, low), high) for stage in (0.0, *info.stages)}
    return [(dict(point), stage) for point in sorted(points) for stage in sorted(stages)]


def _within(one: Range, point: Mapping[str, float]) -> dict[str, float]:
    return {
        name: one.held[name] if name in one.held else min(max(value, one.free[name][0]), one.free[name][1])
        for name, value in point.items()
    }


def _first_look(target: Target, one: Range, point: Mapping[str, float], stage: float) -> Look:
    table = one.table
    # only what the table itself holds is kept: numbers that askers name have no end
    if target.kind == "descriptors" or one.held or one.stage != table.reach:
        return target.of(table, point, stage, True)
    seen = _kept.setdefault(table, {})
    key = (*target.like, tuple(sorted(point.items())), stage)
    if key not in seen:
        seen[key] = target.of(table, point, stage, True)
    return seen[key]


def _scatter(target: Look, found: Look) -> Floats:
    return np.asarray(np.maximum(target.scatter, found.scatter))


def _distance(target: Look, found: Look) -> float:
    return float(np.sqrt(np.mean(((found.values - target.values) / _scatter(target, found)) ** 2)))


def _between(target: Target, one: Range, rows: Sequence[_Row], first: int, last: int) -> list[_Row]:
    """Return shapes all over a table at stages around those of its nearest runs, the first of `rows` of it: of evenly
    spread ones those from the first to before the last.
    """
    from scipy.stats import qmc

    walk = _Walk(target, one)
    if walk.dimension < 2:
        return []
    shares = np.asarray(qmc.Sobol(walk.dimension, scramble=False).random(_BETWEEN))[first:last]
    stages = [row[3] for row in rows if row[1] is one][:_BEST]
    low, high = one.stage
    knots = np.unique([low, *(s for s in (0.0, *one.table.stages) if low < s < high), high])
    step = float(np.diff(knots).max(initial=0.0))
    if walk.has_stage:
        ends = walk.stage_share(min(stages) - step), walk.stage_share(max(stages) + step)
        shares[:, -1] = ends[0] + shares[:, -1] * (ends[1] - ends[0])
    found = []
    for row in shares:
        point, stage = walk.place(row)
        away = _distance(target.seen(True), target.of(one.table, point, stage, True))
        if np.isfinite(away):
            found.append((away, one, point, stage))
    return found


def _starts(rows: Sequence[_Row], nearest: Range) -> list[_Row]:
    """Return where to begin: of some tables the nearest shape, of the nearest one some more, apart from each other."""
    found: list[_Row] = []
    more = 0
    for row in rows:
        if row[0] > _HOPELESS * max(rows[0][0], 0.5):
            break
        mine = [other for other in found if other[1] is row[1]]
        if not mine and len({id(other[1]) for other in found}) < _TABLES:
            found.append(row)
        elif row[1] is nearest and mine and more < _SECOND and all(_apart(row, other) > _APART for other in mine):
            more += 1
            found.append(row)
    return found


def _apart(row: _Row, other: _Row) -> float:
    """Return how far two shapes of a table are apart, of the ranges: the most of any axis or the stage."""
    ranges = {**row[1].free, "": row[1].stage}
    ends = [{**one[2], "": one[3]} for one in (row, other)]
    return max(abs(ends[0][n] - ends[1][n]) / max(high - low, 1e-12) for n, (low, high) in ranges.items())


class _Walk:
    """The way downhill in one table, in coordinates from 0 to 1: logarithms of what spans ratios."""

    def __init__(self, target: Target, one: Range) -> None:
        self._target, self._range = target, one
        self._names = [name for name, (low, high) in one.free.items() if high > low]
        self._fixed = {**one.held, **{n: low for n, (low, high) in one.free.items() if high <= low}}
        bounds = [*(one.free[name] for name in self._names), one.stage]
        if one.stage[1] <= one.stage[0]:
            bounds.pop()
        self._bounds = np.array(bounds, float).reshape(-1, 2)
        low, high = self._bounds.T
        self._logarithmic = (low > 0) & (high > 1.2 * low)
        self._logarithmic[len(self._names) :] = False
        self.looked = 0

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self._bounds)

    @property
    def has_stage(self) -> bool:
        """Whether the stage is one of them, the last."""
        return len(self._bounds) > len(self._names)

    def stage_share(self, stage: float) -> float:
        """Return the coordinate of a stage."""
        low, high = self._bounds[-1]
        return float(np.clip((stage - low) / (high - low), 0, 1))

    def down(self, point: Mapping[str, float], stage: float) -> Candidate:
        """Return the nearest shape that is found from a start."""
        from scipy.optimize import least_squares

        seen = self._target.seen(False)
        at = self._shares([*(point[name] for name in self._names), stage][: len(self._bounds)])
        first = self._look(at)
        known = np.isfinite(first.values)
        scatter = _scatter(seen, first)

        def off(shares: Floats) -> Floats:
            return np.asarray((self._look(shares).values - seen.values)[known] / scatter[known])

        if not len(self._bounds):
            return self._candidate(at, off(at), np.zeros((0, 0)), known)
        inside = np.clip(at, 1e-3, 1 - 1e-3)
        best = least_squares(
            off,
            inside,
            bounds=(0, 1),
            diff_step=np.full(len(inside), _STEP),
            max_nfev=_STEPS,
            x_scale=1.0,
            xtol=1e-5,
            ftol=1e-6,
        )
        return self._candidate(best.x, best.fun, np.asarray(best.jac), known)

    def _look(self, shares: Floats) -> Look:
        self.looked += 1
        point, stage = self.place(shares)
        return self._target.of(self._range.table, point, stage, False)

    def _values(self, shares: Floats) -> Floats:
        low, high = self._bounds.T
        plain = low + shares * (high - low)
        safe = np.where(self._logarithmic, low, 1.0)
        ratio = np.where(self._logarithmic, high / np.where(safe == 0, 1.0, safe), 1.0)
        return np.asarray(np.clip(np.where(self._logarithmic, safe * ratio**shares, plain), low, high))

    def _shares(self, values: Sequence[float]) -> Floats:
        low, high = self._bounds.T
        x = np.asarray(values, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(self._logarithmic, np.log(x / low) / np.log(high / low), (x - low) / (high - low))
        return np.asarray(np.clip(found, 0, 1))

    def place(self, shares: Floats) -> tuple[dict[str, float], float]:
        """Return the point and the stage of coordinates."""
        values = self._values(shares).tolist()
        stage = values[-1] if len(values) > len(self._names) else self._range.stage[0]
        return {**self._fixed, **dict(zip(self._names, values, strict=False))}, stage

    def _candidate(self, shares: Floats, off: Floats, jacobian: Floats, known: np.ndarray) -> Candidate:
        point, stage = self.place(shares)
        names = [*self._names, ""][: len(shares)]
        # what is not known at all is uniform over the range
        inverse = np.linalg.inv(jacobian.T @ jacobian + 12 * np.eye(len(shares))) if len(shares) else np.zeros((0, 0))
        distance = float(np.sqrt(np.mean(off**2)))
        shaky = np.sqrt(np.diag(inverse)) * max(1.0, distance)
        step = 1e-4
        slope = [
            (self._values(np.clip(shares + step, 0, 1))[k] - self._values(np.clip(shares - step, 0, 1))[k])
            / (min(shares[k] + step, 1) - max(shares[k] - step, 0))
            for k in range(len(shares))
        ]
        parts: dict[str, list[float]] = {}
        for name, value in zip(np.array(self._target.parts)[known], off, strict=True):
            parts.setdefault(str(name), []).append(float(value))
        edges = tuple(n for n, share in zip(names, shares, strict=True) if share < 1e-3 or share > 1 - 1e-3)
        return Candidate(
            self._range.table,
            point,
            stage,
            distance,
            {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in parts.items()},
            dict(zip(names, (np.array(slope) * shaky).tolist(), strict=True)),
            edges,
        )


def _distinct(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates without those that came to the same place."""
    found: list[Candidate] = []
    for one in candidates:
        if not any(_same(one, other) for other in found):
            found.append(one)
    return found


def _same(one: Candidate, other: Candidate) -> bool:
    if one.table is not other.table:
        return False
    gaps = [abs(one.stage - other.stage) <= max(3 * other.deviation.get("", 0.0), 0.005)]
    for name, value in one.point.items():
        least = 0.02 * abs(other.point[name])
        gaps.append(abs(value - other.point[name]) <= max(3 * other.deviation.get(name, 0.0), least))
    return all(gaps)
