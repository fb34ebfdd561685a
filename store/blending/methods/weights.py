"""Weightings: which samples take part in an answer, and how much of each. Weights sum to 1; a sample that is hit
takes all.

`idw` is the paper's: inverse distance in parameters scaled to 0..1 (Eq. 13-14), among the nearest m; it jumps where
the set of the nearest changes, and so does `nearest`. The others are continuous everywhere.
"""

from __future__ import annotations

import bisect
import math
from functools import cached_property

import numpy as np

from solver.arrays import Array

from ..neighbours import SAME, Neighbours, Weighted

__all__ = ["Samples"]

#: Weightings that are `linear` on grids; what the others make of it is in `thin` and `lean`.
_LINEAR = ("linear", "thin", "lean")


class Samples:
    """The samples of a table as points (count, axes), and all ways to weigh them."""

    def __init__(self, values: Array) -> None:
        self.values = values
        self._idw = Neighbours(values)
        # ratios of lengths and moduli matter, not differences: an axis that stays above zero counts by its logarithm
        self._logarithmic = values.min(axis=0) > 0
        logs = self._log(values)
        self._low, span = logs.min(axis=0), np.ptp(logs, axis=0)
        self._span = np.where(span > 0, span, 1)
        self._scales = list(zip(self._logarithmic.tolist(), self._low.tolist(), self._span.tolist(), strict=True))
        self.points = (logs - self._low) / self._span
        self._near = Neighbours(self.points) if (span > 0).all() else self._idw
        self._grid = _Grid.find(self.points)

    @property
    def is_grid(self) -> bool:
        """Whether the samples are all the nodes of a grid."""
        return self._grid is not None

    def scale(self, query: Array) -> Array:
        """Return a point's place (axes,) among `points`: logarithms scaled to 0..1."""
        # one by one: so few numbers take longer as arrays
        scales = zip(query.tolist(), self._scales, strict=True)
        return np.array([((math.log(x) if is_log else x) - low) / span for x, (is_log, low, span) in scales])

    def unscale(self, point: Array) -> Array:
        """Return the place (axes,) of which `scale` makes `point`."""
        logs = self._low + point * self._span
        return np.where(self._logarithmic, np.exp(np.where(self._logarithmic, logs, 0.0)), logs)

    def weigh(self, weighting: str, query: Array, m: int, eta: float) -> Weighted:
        """Weigh the samples for a point (axes,); `m` and `eta` only matter to `idw` and `scattered`."""
        if weighting == "idw":
            return self._idw.weigh(query, m, eta)
        if weighting == "nearest":
            return self._idw.weigh(query, 1, eta)
        if weighting in _LINEAR and self._grid is not None:
            found = self._grid.weigh(self.scale(query))
        else:
            found = self._scattered(self.scale(query), m, eta)
        nearest = self._idw.distance(query)
        if nearest == 0.0:
            return Weighted(found.samples[[int(np.argmax(found.weights))]], np.ones(1), 0.0)
        return Weighted(*found[:2], nearest)

    def _scattered(self, point: Array, m: int, eta: float) -> Weighted:
        """Franke and Little's weights, ((R - d) / (R d))^eta: zero at the distance R of the first one left out."""
        return self._near.fade(point, m, eta)

    def contains(self, query: Array) -> bool:
        """Return whether a point lies in the convex hull of the samples in the scaled axes."""
        if self._grid is not None:
            return all(-SAME <= x <= 1 + SAME for x in self.scale(query).tolist())
        from scipy.optimize import nnls  # not for grids: it takes long to import

        system, right = self._hull, np.append(self.scale(query), 1.0)
        return bool(nnls(system, right)[1] < 1e-7)

    @cached_property
    def _hull(self) -> Array:
        return np.vstack([self.points.T, np.ones(len(self.points))])

    @cached_property
    def spacing(self) -> Array:
        """Distance (count,) from each sample to the nearest other one, scaled as `Weighted.nearest` is."""
        return self._idw.spacing

    def without(self, i: int, weighting: str = "linear") -> Weighted:
        """Weigh the others for sample `i`, as if it were not there.

        On a grid, `linear` takes its neighbours on both sides along all axes where it has both. At a corner there are
        none, and all that is left is extrapolation by inverse distance.

        Raises:
            ValueError: there are no others.

        """
        if len(self.points) == 1:
            raise ValueError("a single sample cannot be predicted from others")
        if weighting in _LINEAR and self._grid is not None:
            found = self._grid.without(i)
            if found is not None:
                return found
        return self._idw.without(i, 1 if weighting == "nearest" else 6)

    def adjacent(self) -> list[tuple[int, int]]:
        """Return the pairs of neighbouring samples: along the lines of a grid, else each with its nearest."""
        if self._grid is not None:
            return self._grid.edges()
        return sorted({(min(pair), max(pair)) for pair in self._near.pairs()})

    def _log(self, values: Array) -> Array:
        safe = np.where(self._logarithmic, values, 1.0)
        return np.where(self._logarithmic, np.log(safe), values)


class _Grid:
    """Samples (count, axes) that are all nodes of a grid; `numbers` (axes...) says which sample is which node."""

    def __init__(self, ticks: list[Array], numbers: Array) -> None:
        self._ticks, self._numbers = [tick.tolist() for tick in ticks], numbers
        self._flat = numbers.ravel().tolist()
        self._nodes = {int(number): node for node, number in np.ndenumerate(numbers)}

    @classmethod
    def find(cls, points: Array) -> _Grid | None:
        ticks, places = [], []
        for column in points.T:
            order = np.sort(column)
            firsts = order[np.append(True, np.diff(order) > SAME)]
            ticks.append(firsts)
            places.append(np.abs(column[:, None] - firsts).argmin(axis=1))
        shape = tuple(len(tick) for tick in ticks)
        if np.prod([float(count) for count in shape]) != len(points):
            return None
        numbers = np.full(shape, -1)
        numbers[tuple(places)] = np.arange(len(points))
        return None if (numbers < 0).any() else cls(ticks, numbers)

    def weigh(self, point: Array) -> Weighted:
        sides = []
        for tick, x in zip(self._ticks, point.tolist(), strict=True):
            j = min(max(bisect.bisect_right(tick, x) - 1, 0), max(len(tick) - 2, 0))
            part = 0.0 if len(tick) == 1 else min(max((x - tick[j]) / (tick[j + 1] - tick[j]), 0.0), 1.0)
            part = round(part) if abs(part - round(part)) < SAME else part
            sides.append([(k, w) for k, w in ((j, 1 - part), (j + 1, part)) if w > 0])
        return self._product(sides)

    def without(self, i: int) -> Weighted | None:
        sides, inner = [], False
        for tick, j in zip(self._ticks, self._nodes[i], strict=True):
            if 0 < j < len(tick) - 1:
                part, inner = float((tick[j] - tick[j - 1]) / (tick[j + 1] - tick[j - 1])), True
                sides.append([(j - 1, 1 - part), (j + 1, part)])
            else:
                sides.append([(j, 1.0)])
        return self._product(sides) if inner else None

    def edges(self) -> list[tuple[int, int]]:
        pairs = []
        for axis in range(self._numbers.ndim):
            moved = np.moveaxis(self._numbers, axis, 0)
            pairs += list(zip(moved[:-1].ravel().tolist(), moved[1:].ravel().tolist(), strict=True))
        return pairs

    def _product(self, sides: list[list[tuple[int, float]]]) -> Weighted:
        corners = [(0, 1.0)]
        for count, side in zip(self._numbers.shape, sides, strict=True):
            corners = [(place * count + k, weight * w) for place, weight in corners for k, w in side]
        samples = np.array([self._flat[place] for place, _ in corners])
        return Weighted(samples, np.array([weight for _, weight in corners]), float("nan"))
