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

from ...surfaces import harmonics
from ...surfaces.packed import Stored
from ..neighbours import Weighted
from .lean import leaning
from .weights import Samples

__all__ = ["Mixture", "Thin", "outer"]

#: Correlation of a sample's wrinkles with its neighbours' at which the spline begins to count, and is all that counts.
_UNLIKE, _ALIKE = 0.5, 0.8
#: Sums of the weights' sizes up to which a spline counts whole, and from which on not at all.
_CALM, _WILD = 2.0, 3.0
#: Samples that one spline passes through: all of a small table, the nearest of a large one.
_ALL, _MOST = 16, 12
#: Power [r1^2] below which there is no pattern to be like.
_NOTHING = 1e-12


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


class Thin:
    """Splines through the samples of a table with spectra (sample, stage, component, m, k, part)."""

    def __init__(self, stored: Stored, samples: Samples) -> None:
        self._stored, self._points = stored, samples.points
        self._beside: dict[int, list[int]] = {}
        for a, b in samples.adjacent():
            self._beside.setdefault(a, []).append(b)
            self._beside.setdefault(b, []).append(a)
        self._spline = lru_cache(maxsize=256)(self._spline_of)
        self._share = lru_cache(maxsize=4096)(self._share_of)

    def mix(
        self, near: Weighted, point: Array, stages: Sequence[int], without: int | None = None, lean: bool = False
    ) -> Mixture:
        """Return `linear` weights `near` of a point (axes,) among `Samples.points`, mixed with the splines' as far as
        these count; `without` one sample, as if it were not there. To `lean` is to lean to the nearest in the rest.
        """
        if len(near.samples) == 1:  # a spline passes through it
            share = np.array([self._share(int(near.samples[0]), j) for j in stages])
            return Mixture(near.samples, np.ones((1, len(stages))), 1 - share)
        shares: dict[_Spline, Array] = {}
        alike = np.zeros(len(stages))
        for i, weight in zip(near.samples.tolist(), near.weights.tolist(), strict=True):
            spline = self._spline(i, without)
            share = weight * np.array([self._share(i, j) for j in stages])
            alike += share
            if spline is not None:
                shares[spline] = shares.get(spline, 0.0) + share
        # weights of samples that are alike stay as they are
        leans = lean and float(alike.min(initial=1.0)) < 1
        rest = leaning(near.weights, alike) if leans else outer(near, len(stages)).weights
        found = [(spline, share) for spline, share in shares.items() if share.any()]
        if not found:
            return Mixture(near.samples, rest, np.ones(len(stages)))
        taken = sorted({*near.samples.tolist(), *(i for spline, _ in found for i in spline.samples)})
        place = {i: k for k, i in enumerate(taken)}
        weights, left = np.zeros((len(taken), len(stages))), np.ones(len(stages))
        lossy = np.maximum(left - sum(share for _, share in found), 0.0)
        for spline, share in found:
            own = spline.weights(point)
            counts = share * _ramp(float(np.abs(own).sum()), _WILD, _CALM)
            weights[[place[i] for i in spline.samples]] += np.multiply.outer(own, counts)
            left -= counts
        weights[[place[i] for i in near.samples.tolist()]] += rest * left
        return Mixture(np.array(taken), weights, lossy)

    def _spline_of(self, i: int, without: int | None) -> _Spline | None:
        distance = np.linalg.norm(self._points - self._points[i], axis=1)
        order = [k for k in np.argsort(distance, kind="stable").tolist() if k != without]
        chosen = tuple(sorted(order if len(order) <= _ALL else order[:_MOST]))
        return _kept(chosen, self._points[list(chosen)].tobytes(), self._points.shape[1])

    def _share_of(self, i: int, j: int) -> float:
        """Return how far the spline counts at sample `i` and stage `j`."""
        own, *others = (
            harmonics.degrees(self._stored[k, j].view(np.result_type(self._stored.dtype, np.complex64))[..., 0])
            for k in (i, *self._beside.get(i, ()))
        )
        power = _product(own, own)
        if power < _NOTHING:
            return 1.0
        alike = [_product(own, one) / max(np.sqrt(power * _product(one, one)), _NOTHING) for one in others]
        return _ramp(float(np.mean(alike)) if alike else 0.0, _UNLIKE, _ALIKE)


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


def _product(a: Array, b: Array) -> float:
    """Return the mean product of the wrinkles of harmonics (component, m, l)."""
    return float(harmonics.power(a, b)[:, harmonics.LOWEST :].sum())


def _ramp(value: float, none: float, whole: float) -> float:
    part = min(max((value - none) / (whole - none), 0.0), 1.0)
    return part * part * (3 - 2 * part)
