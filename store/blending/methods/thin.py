"""thin: thin-plate splines through the samples where neighbours share their pattern, `linear` where they do not.

A spline is linear in what it passes through: at a point it is a weighted mean of the samples, with weights that sum to
1 and may be negative. It follows how a pattern changes from sample to sample, and keeps what a linear mean loses of it;
of patterns that are not one pattern it makes as little as any mean does, and farther samples only blur it. So each
sample's share of the answer is taken by the spline through the samples around it as far as it is like its neighbours,
stage by stage: all of it from a correlation of `_ALIKE` on, nothing below `_UNLIKE`, and smoothly in between. Where a
spline's weights would cancel each other (far outside the samples), it fades as well. Nothing of this jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from ..neighbours import Weighted
from .lean import leaning
from .products import Products
from .weights import Samples

__all__ = ["Mixture", "Thin", "outer"]

#: Correlation of a sample's wrinkles with its neighbours' at which the spline begins to count, and is all that counts.
_UNLIKE, _ALIKE = 0.5, 0.8
#: Sums of the weights' sizes up to which a spline counts whole, and from which on not at all.
_CALM, _WILD = 2.0, 3.0
#: Samples that one spline passes through: all of a small table, the nearest of a large one.
_ALL, _MOST = 16, 12
#: What is left of 1 after all shares, at most, where they sum to it.
_ROUNDED = 1e-12


class Mixture(NamedTuple):
    """Samples that take part, with `weights` (samples, stages) whose columns sum to 1, and the share (stages,) in which
    the mean is `lossy`: one of patterns that need not agree, whose power is to be given back.
    """

    samples: Array
    weights: Array
    lossy: Array


def outer(near: Weighted, stages: int) -> Mixture:
    """Return the same weights for so many stages."""
    return Mixture(near.samples, np.repeat(near.weights[:, None], stages, axis=1), np.ones(stages))


class _Cell(NamedTuple):
    """What is known of some samples at some stages: how far the splines count at them, `shares` (samples, stages); all
    that are `taken` part of the splines and they, among which their own `places` are; and each spline, with its
    samples' places and what it has of the shares.
    """

    shares: Array
    taken: Array
    places: Array
    splines: list[tuple[_Spline, Array, Array]]


class Thin:
    """Splines through the samples of a table."""

    def __init__(self, products: Products, samples: Samples) -> None:
        self._products, self._points = products, samples.points
        self._beside: dict[int, list[int]] = {}
        for a, b in samples.adjacent():
            self._beside.setdefault(a, []).append(b)
            self._beside.setdefault(b, []).append(a)
        self._spline = lru_cache(maxsize=256)(self._spline_of)
        self._share = lru_cache(maxsize=4096)(self._share_of)
        self._cell = lru_cache(maxsize=1024)(self._cell_of)

    def mix(
        self, near: Weighted, point: Array, stages: Sequence[int], without: int | None = None, lean: bool = False
    ) -> Mixture:
        """Return `linear` weights `near` of a point (axes,) among `Samples.points`, mixed with the splines' as far as
        these count; `without` one sample, as if it were not there. To `lean` is to lean to the nearest in the rest.
        """
        if len(near.samples) == 1:  # a spline passes through it
            share = np.array([self._share(int(near.samples[0]), j) for j in stages])
            return Mixture(near.samples, np.ones((1, len(stages))), 1 - share)
        known = self._cell(tuple(near.samples.tolist()), tuple(stages), without)
        alike = near.weights @ known.shares
        # weights of samples that are alike stay as they are
        leans = lean and float(alike.min(initial=1.0)) < 1
        rest = leaning(near.weights, alike) if leans else outer(near, len(stages)).weights
        if not known.splines:
            return Mixture(near.samples, rest, np.ones(len(stages)))
        weights, left = np.zeros((len(known.taken), len(stages))), np.ones(len(stages))
        lossy = left.copy()
        for spline, places, own_shares in known.splines:
            share, own = near.weights @ own_shares, spline.weights(point)
            counts = share * _ramp(float(np.abs(own).sum()), _WILD, _CALM)
            weights[places] += np.multiply.outer(own, counts)
            left -= counts
            lossy -= share
        weights[known.places] += rest * left
        # shares that are all of it sum to 1 but for round-off, for which nothing is to be given back
        return Mixture(known.taken, weights, np.where(lossy < _ROUNDED, 0.0, lossy))

    def _cell_of(self, samples: tuple[int, ...], stages: tuple[int, ...], without: int | None) -> _Cell:
        shares = np.array([[self._share(i, j) for j in stages] for i in samples]).reshape(len(samples), -1)
        of_spline: dict[_Spline, Array] = {}
        for k, i in enumerate(samples):
            spline = self._spline(i, without)
            if spline is not None and shares[k].any():
                of_spline.setdefault(spline, np.zeros_like(shares))[k] = shares[k]
        taken = sorted({*samples, *(i for spline in of_spline for i in spline.samples)})
        place = {i: k for k, i in enumerate(taken)}
        splines = [(one, np.array([place[i] for i in one.samples]), own) for one, own in of_spline.items()]
        return _Cell(shares, np.array(taken), np.array([place[i] for i in samples]), splines)

    def _spline_of(self, i: int, without: int | None) -> _Spline | None:
        distance = np.linalg.norm(self._points - self._points[i], axis=1)
        order = [k for k in np.argsort(distance, kind="stable").tolist() if k != without]
        chosen = tuple(sorted(order if len(order) <= _ALL else order[:_MOST]))
        return _kept(chosen, self._points[list(chosen)].tobytes(), self._points.shape[1])

    def _share_of(self, i: int, j: int) -> float:
        """Return how far the spline counts at sample `i` and stage `j`."""
        alike = self._products.likeness(i, tuple(self._beside.get(i, ())), j)
        return 1.0 if alike is None else _ramp(alike, _UNLIKE, _ALIKE)


class _Spline:
    """A thin-plate spline with a plane, through points (count, axes)."""

    def __init__(self, samples: tuple[int, ...], points: Array) -> None:
        self.samples = samples
        self._points = points
        count, axes = points.shape
        plane = np.column_stack([np.ones(count), points])
        apart = np.linalg.norm(points[:, None] - points, axis=-1)
        system = np.block([[_kernel(apart), plane], [plane.T, np.zeros((axes + 1, axes + 1))]])
        self._solved = np.linalg.inv(system)[:count]

    def weights(self, point: Array) -> Array:
        """Return the samples' weights (count,) at a point (axes,)."""
        away = self._points - point
        right = np.concatenate([_kernel(np.sqrt(np.einsum("ij,ij->i", away, away))), [1.0], point])
        found: Array = self._solved @ right
        return found


@lru_cache(maxsize=256)
def _kept(samples: tuple[int, ...], points: bytes, axes: int) -> _Spline | None:
    """Return the one spline through these samples; None where they fix no plane."""
    places = np.frombuffer(points).reshape(-1, axes)
    plane = np.column_stack([np.ones(len(places)), places])
    return _Spline(samples, places) if np.linalg.matrix_rank(plane, tol=1e-6) == axes + 1 else None


def _kernel(distance: Array) -> Array:
    found: Array = distance * distance * np.log(np.maximum(distance, 1e-150))
    return found


def _ramp(value: float, none: float, whole: float) -> float:
    part = min(max((value - none) / (whole - none), 0.0), 1.0)
    return part * part * (3 - 2 * part)
