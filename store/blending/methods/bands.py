"""LL: give the weighted mean back the power by degree that incoherent samples take from each other.

The target lies between the samples in three ways, each where it is smooth in the parameters: total power by its
logarithm, the shape of the spectrum by the Wasserstein mean (the quantiles of ln l are averaged, so that a peak moves
instead of splitting in two), and its centroid with it. Total and centroid also follow a log-linear fit over the table
wherever the weights alone do not reproduce it. At a sample all three are its own. Between stages amplitudes change
linearly, as displacements do, and below the onset there is no power to divide by: then nothing is corrected.

Where patterns agree (`thin`) the mean gets back what it has lost of its own terms (`regained`), and no more.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from ...kept import Kept
from ...surfaces import alone, harmonics, steps
from . import poles
from .weights import Samples

__all__ = ["Bands", "Targets", "add_up", "multiplier", "regained"]


#: Bands per doubling of the degree.
_PER_OCTAVE = 3
#: Power [r1^2] of nothing: the square of the amplitude below which a surface counts as smooth.
_NOTHING = 1e-10
#: Share of the power below which a band is not corrected, and of a spectrum that is spread evenly.
_FAINT = 1e-3
#: No band is made stronger or weaker than this: sixteen incoherent samples lose a factor of four.
_MOST = 4.0
#: Share of the height (rms) up to which what a mean has lost is left, and from which on all of it is given back: so
#: little is not worth a sixth of a look-up's time.
_LITTLE, _MUCH = 2e-3, 6e-3
_QUANTILES = (np.arange(48) + 0.5) / 48
#: Least way [ln l] from one quantile to the next; of a spectrum that is a single band it is five times that.
_LEAST_RISE = 1e-3
#: Bytes of what leads from gains to factors that are kept over all tables: 50 kB at 64 colatitudes, .2 MB at 128.
_ROOM = 8 << 20


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
        back = self._shares(quantiles)
        back /= back.sum(axis=1, keepdims=True)
        true = (own + even) / (own + even).sum(axis=-1, keepdims=True)
        self._mended = np.log(true / back.reshape(true.shape))
        self._quantiles = quantiles.reshape(*true.shape[:-1], -1)
        self._points = samples.points
        self._known = lru_cache(maxsize=512)(self._known_of)  # some 10 kB each
        fitted = len(self._points) >= self._points.shape[1] + 2
        self._total_slope = _slopes(self._points, self._total, fitted)
        self._centroid_slope = _slopes(self._points, self._quantiles.mean(axis=-1), fitted)

    def gains(self, point: Array, samples: Array, weights: Array, stages: dict[int, float], mean: Array) -> Array:
        """Return the factor (bands,) on amplitudes for a weighted mean that has power `mean` (bands,).

        `point` (axes,) is the query among `Samples.points`; `weights` are (samples, stages).
        """
        amplitudes = np.sqrt(self._powers(point, tuple(samples.tolist()), weights, tuple(stages)))
        wanted = (np.array(list(stages.values())) @ amplitudes) ** 2
        least = _FAINT * (float(mean.sum()) / len(mean)) + _NOTHING
        found: Array = np.minimum(np.maximum(np.sqrt((wanted + least) / (mean + least)), 1 / _MOST), _MOST)
        return found

    def _powers(self, point: Array, samples: tuple[int, ...], weights: Array, stages: tuple[int, ...]) -> Array:
        """Return the powers (stages, bands) wanted at stored stages."""
        known, bands = self._known(samples, stages), len(self.bands.first)
        mean = (weights.T[:, None] @ known.rows)[:, 0]
        to_total, to_centroid = known.slopes @ point
        total = np.exp(mean[:, 0] + to_total)
        moved = _rising(mean[:, 1:-bands]) + to_centroid[:, None]
        shares = self._shares(moved)
        shares *= np.exp(mean[:, -bands:])
        shares *= (np.maximum(total - _NOTHING, 0) / shares.sum(axis=1))[:, None]
        return shares

    def _known_of(self, samples: tuple[int, ...], stages: tuple[int, ...]) -> _Known:
        i, j = np.array(samples), np.array(stages)[:, None]
        slopes = np.stack([self._total_slope[j[:, 0]], self._centroid_slope[j[:, 0]]])
        own = (slopes @ self._points[i].T)[..., None]
        rows = [self._total[i, j][..., None] - own[0], self._quantiles[i, j] - own[1], self._mended[i, j]]
        return _Known(np.concatenate(rows, axis=-1), slopes)

    def _shares(self, quantiles: Array) -> Array:
        """Return the shares (count, bands), which sum to about 1, of distributions given by their quantiles; no band is
        quite empty.
        """
        knots = np.empty((len(quantiles), quantiles.shape[1] + 2))
        knots[:, 1:-1] = quantiles
        knots[:, 0] = 2 * quantiles[:, 0] - quantiles[:, 1]
        knots[:, -1] = 2 * quantiles[:, -1] - quantiles[:, -2]
        below = np.array([np.interp(self.bands.edges, row, _KNOTS, left=0, right=1) for row in knots])
        below[:, 0], below[:, -1] = 0, 1
        shares: Array = below[:, 1:] - below[:, :-1]
        shares += 1e-4
        return shares


def regained(parts: Array, power: Array, mean: Array) -> Array:
    """Return the factor (bands,) on amplitudes that gives a weighted mean of power `mean` (bands,) those of its terms.

    `parts` (T,) are the weights, `power` (T, T, bands) the products of the terms by band. Where patterns agree no fit
    to the table is needed: that their creases lie a little apart takes some from the mean, most from its shortest
    waves, and how much is known.
    """
    own = np.sqrt(np.maximum(power[np.diag_indices(len(parts))], 0))
    # weights that are negative make amplitudes so
    wanted = np.maximum(parts @ own, 0) ** 2
    height = math.sqrt((float(wanted.sum()) + _NOTHING) / (float(mean.sum()) + _NOTHING))
    share = min(max((height - 1 - _LITTLE) / (_MUCH - _LITTLE), 0.0), 1.0)
    if share == 0:
        return np.ones(len(mean))
    least = _FAINT * (float(mean.sum()) / len(mean)) + _NOTHING
    found: Array = np.minimum(np.maximum(np.sqrt((wanted + least) / (mean + least)), 1 / _MOST), _MOST) ** share
    return found


def _rising(quantiles: Array) -> Array:
    """Return quantiles (stages, count), which negative weights may have turned round, in order again, about the same
    mean.

    None are alike: power that lies at a point would change its band at once as that point passes an edge.
    """
    rises = np.diff(quantiles, axis=1)
    if rises.min() >= _LEAST_RISE:
        return quantiles
    found = np.zeros_like(quantiles)
    np.maximum(rises, _LEAST_RISE).cumsum(axis=1, out=found[:, 1:])
    found += (quantiles.mean(axis=1) - found.mean(axis=1))[:, None]
    return found


class _Known(NamedTuple):
    """What is known at some stages of some samples: `rows` (stages, samples, ...) of their total, quantiles and mended
    shares, the first two as they were at the points' origin; and the `slopes` (2, stages, axes) of totals and
    centroids, which lead from there to a point.
    """

    rows: Array
    slopes: Array


_KNOTS = np.concatenate([[0.0], _QUANTILES, [1.0]])


def _slopes(points: Array, values: Array, fitted: bool) -> Array:
    """Return the slopes (stage, axes) of a linear fit to values (sample, stage); zero where too few samples fix it."""
    if not fitted:
        return np.zeros((values.shape[1], points.shape[1]))
    offsets = points - points.mean(axis=0)
    found: Array = np.linalg.lstsq(offsets, values - values.mean(axis=0), rcond=1e-6)[0].T
    return found


def multiplier(gains: Array, bands: Bands, band: int) -> Array:
    """Return the factor (m, k), m, k <= `band`, on amplitudes of the double Fourier sphere for gains by degree.

    A factor by hypot(m, k), the degree of a mode where it is at home, costs one product; by true degree it would cost
    more than all else. A harmonic has modes below its degree too, so that gains leak into the bands above: what leaks
    is known, and taken out beforehand. The shape of the fruit, below `LOWEST`, keeps the factor 1.
    """
    sharp = np.minimum(np.maximum(1 + _unleak(bands.highest) @ (gains - 1), 1 / _MOST), _MOST)
    values = np.zeros(len(sharp) + 1, np.float32)
    np.subtract(sharp, 1, out=values[:-1], casting="same_kind")
    ramp = _kept.get((band, bands.highest), lambda: _ramp(band, tuple(bands.centres.tolist())))
    return steps.now().ramp(values, *ramp).reshape(band + 1, band + 1)


class _Ramp(NamedTuple):
    """`_spreading` without its zeros: the first band (m k,) that counts at a mode, how far, and how far the next."""

    place: Array
    low: Array
    high: Array


def _ramp(band: int, centres: tuple[float, ...]) -> _Ramp:
    spread = np.column_stack([_spreading(band, centres), np.zeros((band + 1) ** 2)]).astype(np.float32)
    place = np.minimum((spread != 0).argmax(axis=1), len(centres) - 1)
    mode = np.arange(len(place))
    return _Ramp(place.astype(np.int32), spread[mode, place], spread[mode, place + 1])


_kept: Kept[tuple[int, int], _Ramp] = Kept(_ROOM, lambda ramp: sum(part.nbytes for part in ramp))


def _spreading(band: int, centres: tuple[float, ...]) -> Array:
    """Return the matrix (m k, bands) from gains to the factor (m, k), both less 1, which is linear in ln hypot(m, k)
    between the bands' centres.
    """
    upper, part = (values.ravel() for values in _places(band, centres))
    # the ends: the shape of the fruit, whose factor is 1, and beyond the last band as in it
    ends = np.concatenate([np.zeros((1, len(centres))), np.eye(len(centres)), np.eye(len(centres))[-1:]])
    spread: Array = ends[upper - 1] * (1 - part)[:, None] + ends[upper] * part[:, None]
    return spread


@lru_cache(maxsize=8)
def _unleak(highest: int) -> Array:
    """Return the matrix (bands, bands) from gains by degree to gains by hypot(m, k), both less 1."""
    bands, shares = Bands(highest), harmonics.shares(highest)
    spread = _spreading(highest, tuple(bands.centres.tolist()))
    size = np.diff([*bands.first, highest + 1])
    passed = alone.product(shares.reshape(highest + 1, -1), spread)
    return np.linalg.inv(np.add.reduceat(passed, bands.first, axis=0) / size[:, None])


def _places(band: int, centres: tuple[float, ...]) -> tuple[Array, Array]:
    """Return for every mode the band above it among [shape of the fruit, bands..., end], and how near that one is."""
    waves = np.arange(band + 1.0)
    degree = np.log(np.maximum(np.hypot(waves[:, None], waves), 1))
    knots = np.concatenate([[np.log(2.9)], centres, [np.log(3.0 * band + 3)]])
    upper = np.clip(np.searchsorted(knots, degree, side="right"), 1, len(knots) - 1)
    return upper, np.clip((degree - knots[upper - 1]) / (knots[upper] - knots[upper - 1]), 0, 1)
