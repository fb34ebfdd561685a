"""LL: give the weighted mean back the power by degree that incoherent samples take from each other.

The target lies between the samples in three ways, each where it is smooth in the parameters: total power by its
logarithm, the shape of the spectrum by the Wasserstein mean (the quantiles of ln l are averaged, so that a peak moves
instead of splitting in two), and its centroid with it. Total and centroid also follow a log-linear fit over the table
wherever the weights alone do not reproduce it. At a sample all three are its own. Between stages amplitudes change
linearly, as displacements do, and below the onset there is no power to divide by: then nothing is corrected.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import harmonics
from . import poles
from .weights import Samples

__all__ = ["Bands", "Targets", "add_up", "multiplier"]

Array = NDArray[Any]

#: Bands per doubling of the degree.
_PER_OCTAVE = 3
#: Power [r1^2] of nothing: the square of the amplitude below which a surface counts as smooth.
_NOTHING = 1e-10
#: Share of the power below which a band is not corrected, and of a spectrum that is spread evenly.
_FAINT = 1e-3
#: No band is made stronger or weaker than this: sixteen incoherent samples lose a factor of four.
_MOST = 4.0
_QUANTILES = (np.arange(48) + 0.5) / 48


class Bands:
    """Bands of degrees `LOWEST`..`highest`; `first` (bands,) is each one's first degree, `edges` those of ln l."""

    def __init__(self, highest: int) -> None:
        self.highest = highest
        octaves = np.log2((highest + 1) / harmonics.LOWEST)
        ends = harmonics.LOWEST * 2 ** (np.arange(max(int(octaves * _PER_OCTAVE), 1) + 1) / _PER_OCTAVE)
        self.first = np.unique(np.ceil(ends[ends <= highest] - 1e-9).astype(int))
        self.edges = np.log(np.append(self.first, highest + 1) - 0.5)
        self.centres = (self.edges[1:] + self.edges[:-1]) / 2


def add_up(power: Array, bands: Bands) -> Array:
    """Return the power by band (..., bands) of powers by degree (..., l)."""
    return np.add.reduceat(power, bands.first, axis=-1)


class Targets:
    """What the spectra of a table say about the spectrum between them; from powers by degree (sample, stage, l)."""

    def __init__(self, power: Array, samples: Samples) -> None:
        self.bands = Bands(power.shape[-1] - 1)
        self.highest = poles.highest_degree(power)
        own = add_up(np.asarray(power, float), self.bands)
        even = _NOTHING / own.shape[-1]
        self._total = np.log(own.sum(axis=-1) + _NOTHING)
        shares = own + even + _FAINT * own.mean(axis=-1, keepdims=True)
        shares /= shares.sum(axis=-1, keepdims=True)
        below = np.concatenate([np.zeros((*shares.shape[:-1], 1)), shares.cumsum(axis=-1)], axis=-1)
        flat = below.reshape(-1, below.shape[-1])
        quantiles = np.array([np.interp(_QUANTILES, row, self.bands.edges) for row in flat])
        # what quantiles and back do to a sample's own spectrum is undone in the same proportion
        back = np.array([self._shares(row) for row in quantiles])
        true = (own + even) / (own + even).sum(axis=-1, keepdims=True)
        self._mended = true / back.reshape(true.shape)
        self._quantiles = quantiles.reshape(*true.shape[:-1], -1)
        self._points = samples.points
        fitted = len(self._points) >= self._points.shape[1] + 2
        self._total_slope = _slopes(self._points, self._total, fitted)
        self._centroid_slope = _slopes(self._points, self._quantiles.mean(axis=-1), fitted)

    def gains(self, point: Array, samples: Array, weights: Array, stages: dict[int, float], mean: Array) -> Array:
        """Return the factor (bands,) on amplitudes for a weighted mean that has power `mean` (bands,).

        `point` (axes,) is the query among `Samples.points`.
        """
        places = list(stages)
        amplitudes = np.sqrt(self._powers(point, samples, weights, places))
        wanted = (np.array(list(stages.values())) @ amplitudes) ** 2
        least = _FAINT * mean.mean() + _NOTHING
        return np.minimum(np.maximum(np.sqrt((wanted + least) / (mean + least)), 1 / _MOST), _MOST)

    def _powers(self, point: Array, samples: Array, weights: Array, stages: list[int]) -> Array:
        """Return the powers (stages, bands) wanted at stored stages."""
        step = point - weights @ self._points[samples]
        at = samples[:, None], np.array(stages)
        total = np.exp(weights @ self._total[at] + self._total_slope[stages] @ step)
        moved = _weigh(weights, self._quantiles[at])
        moved += (self._centroid_slope[stages] @ step)[:, None]
        shares = np.array([self._shares(row) for row in moved])
        shares *= _weigh(weights, self._mended[at])
        return np.maximum(total - _NOTHING, 0)[:, None] * shares / shares.sum(axis=1, keepdims=True)

    def _shares(self, quantiles: Array) -> Array:
        """Return the shares (bands,) of a distribution given by its quantiles; no band is quite empty."""
        width = quantiles[1] - quantiles[0], quantiles[-1] - quantiles[-2]
        knots = np.concatenate([[quantiles[0] - width[0]], quantiles, [quantiles[-1] + width[1]]])
        below = np.interp(self.bands.edges, knots, _KNOTS, left=0, right=1)
        below[0], below[-1] = 0, 1
        shares = below[1:] - below[:-1] + 1e-4
        return shares / shares.sum()


_KNOTS = np.concatenate([[0.0], _QUANTILES, [1.0]])


def _weigh(weights: Array, rows: Array) -> Array:
    """Return the weighted sum (s, q) of (t, s, q)."""
    return (weights @ rows.reshape(len(rows), -1)).reshape(rows.shape[1:])


def _slopes(points: Array, values: Array, fitted: bool) -> Array:
    """Return the slopes (stage, axes) of a linear fit to values (sample, stage); zero where too few samples fix it."""
    if not fitted:
        return np.zeros((values.shape[1], points.shape[1]))
    offsets = points - points.mean(axis=0)
    return np.linalg.lstsq(offsets, values - values.mean(axis=0), rcond=1e-6)[0].T


def multiplier(gains: Array, bands: Bands, band: int) -> Array:
    """Return the factor (m, k), m, k <= `band`, on amplitudes of the double Fourier sphere for gains by degree.

    A factor by hypot(m, k), the degree of a mode where it is at home, costs one product; by true degree it would cost
    more than all else. A harmonic has modes below its degree too, so that gains leak into the bands above: what leaks
    is known, and taken out beforehand. The shape of the fruit, below `LOWEST`, keeps the factor 1.
    """
    sharp = np.minimum(np.maximum(1 + _unleak(bands.highest) @ (gains - 1), 1 / _MOST), _MOST)
    return _spread(sharp, bands, band).astype(np.float32)


def _spread(gains: Array, bands: Bands, band: int) -> Array:
    """Return gains (bands,) as a factor (m, k) that is linear in ln hypot(m, k) between the bands' centres."""
    ends = np.concatenate([[1.0], gains, [gains[-1]]])
    upper, part = _places(band, tuple(bands.centres.tolist()))
    return ends[upper - 1] * (1 - part) + ends[upper] * part


@lru_cache(maxsize=8)
def _unleak(highest: int) -> Array:
    """Return the matrix (bands, bands) from gains by degree to gains by hypot(m, k), both less 1."""
    bands, shares = Bands(highest), harmonics.shares(highest)
    size = np.diff([*bands.first, highest + 1])
    leak = np.empty((len(size), len(size)))
    for i, gains in enumerate(np.eye(len(size))):
        passed = (shares * (_spread(1 + gains, bands, highest) - 1)).sum(axis=(1, 2))
        leak[:, i] = np.add.reduceat(passed, bands.first) / size
    return np.linalg.inv(leak)


@lru_cache(maxsize=16)
def _places(band: int, centres: tuple[float, ...]) -> tuple[Array, Array]:
    """Return for every mode the band above it among [shape of the fruit, bands..., end], and how near that one is."""
    waves = np.arange(band + 1.0)
    degree = np.log(np.maximum(np.hypot(waves[:, None], waves), 1))
    knots = np.concatenate([[np.log(2.9)], centres, [np.log(3.0 * band + 3)]])
    upper = np.clip(np.searchsorted(knots, degree, side="right"), 1, len(knots) - 1)
    return upper, np.clip((degree - knots[upper - 1]) / (knots[upper] - knots[upper - 1]), 0, 1)
