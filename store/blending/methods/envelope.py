"""env: give every place the local amplitude of the wrinkles that its samples have there.

Where samples happen to agree their mean is strong, where they cancel it is faint, and the eye sees patches. The
envelope (rms amplitude in a window of 20 degrees) of the mean is brought to the mean of the samples' envelopes by a
smooth factor on the wrinkles; the shape of the fruit keeps its own.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array
from solver.lattice import azimuths, colatitudes

from ...surfaces import alone, harmonics, window
from ...surfaces.harmonics import legendre
from ...surfaces.window import Patch
from .cells import COARSE

__all__ = ["Total", "apply", "at_poles", "factor", "on", "take_low"]


#: Share of the mean square below which a place counts as smooth, and the power [r1^2] of nothing.
_FAINT, _NOTHING = 1e-2, 1e-10
_MOST = 3.0


class Total(NamedTuple):
    """Mean squares of the wrinkles: what they are after LL, and what they are to be."""

    found: float
    wanted: float


def factor(mean: Array, wanted: Array, total: Total | None = None) -> Array:
    """Return the factor on the wrinkles at the places of the coarse lattice (12, 24); between them it is a series.

    `mean` (places,) is the local mean square of the weighted mean, `wanted` the local amplitude it should have. With
    a `total` both are scaled to it first: how much there is of wrinkles is settled, only their places are left to.
    """
    area = _area()
    # weights that are negative make amplitudes so
    mean, wanted = np.maximum(mean, 0), np.maximum(wanted, 0) ** 2
    wanted_total, more = float(area @ wanted), 1.0
    if total is not None:
        more = math.sqrt((total.wanted + _NOTHING) / (total.found + _NOTHING))
        mean = mean * (total.found / (float(area @ mean) + _NOTHING))
        share = total.found / (wanted_total + _NOTHING)
        wanted, wanted_total = wanted * share, wanted_total * share
    least = _FAINT * wanted_total + _NOTHING
    ratio = more * np.sqrt((wanted + least) / (mean + least))
    found: Array = np.minimum(np.maximum(ratio, 1 / _MOST), _MOST).reshape(COARSE, 2 * COARSE)
    return found


def take_low(waves: Array, low: Array) -> None:
    """Subtract harmonics below `LOWEST`, `low` (3, m, l), from spectra (3, m, k)."""
    series = harmonics.low_series(waves.shape[-1] - 1)
    waves[:, : harmonics.LOWEST] -= np.matmul(low.transpose(1, 0, 2), series).transpose(1, 0, 2).astype(waves.dtype)


def apply(planes: Array, ratio: Array, low: Array, patch: Patch) -> None:
    """Multiply wrinkles (c, height, width) on a patch by the factor, given as `ratio` (12, 24) on the coarse lattice,
    and add `low` (3, m, l) of the patch's components: all in place.
    """
    factor, shape = on(ratio, low, patch, planes.dtype)
    planes *= factor
    planes += shape


def on(ratio: Array, low: Array, patch: Patch, kind: np.dtype[Any]) -> tuple[Array, Array]:
    """Return the factor (height, width) and the shape (c, height, width) on a patch, in a precision."""
    if len(patch.components) < len(low):
        low = low[list(patch.components)]
    parts = np.ascontiguousarray(low).view(float).reshape(len(low), -1).astype(kind)
    lines = alone.product(parts, _low_lines(patch.n, patch.top, patch.height, kind.str))
    around = window.around(patch.n, harmonics.LOWEST, patch.left, patch.width, kind.str)
    shape = alone.product(lines.reshape(len(low) * patch.height, -1), around)
    return _on_lattice(ratio, patch, kind), shape.reshape(len(low), patch.height, patch.width)


def at_poles(ratio: Array) -> Array:
    """Return the factor (2,) at the poles, where only its mean over the azimuth is left."""
    found: Array = ratio.ravel() @ _to_poles()
    return found


def _on_lattice(ratio: Array, patch: Patch, kind: np.dtype[Any]) -> Array:
    """Sum the series of `ratio` on a patch (height, width): so few waves are cheaper by matrices than by transforms."""
    down, around = _ways(patch.n, patch.top, patch.height, patch.left, patch.width, kind.str)
    return alone.product(down, (ratio.astype(kind) @ around).reshape(-1, patch.width))


@lru_cache(maxsize=1)
def _area() -> Array:
    return np.repeat(harmonics.area(COARSE), 2 * COARSE)


@lru_cache(maxsize=32)
def _ways(n: int, top: int, height: int, left: int, width: int, dtype: str) -> tuple[Array, Array]:
    """Return the matrices from the coarse lattice to a patch: from azimuths (2, 24, width) for even and for odd m, then
    from the colatitudes of both (height, 2 * 12). Waves that the lattice of `n` cannot hold are left out.
    """
    held = min(COARSE, n)
    waves = np.arange(held + 1)
    apart = np.arange(left, left + width) * np.pi / n - azimuths(COARSE)[:, None]
    both = np.where((waves == 0) | (waves == COARSE), 1.0, 2.0) / (2 * COARSE)
    around = np.stack([np.einsum("m,mjx->jx", both[p::2], np.cos(waves[p::2, None, None] * apart)) for p in (0, 1)])
    cosines, sines = _series(held)
    angles = np.outer((np.arange(top, top + height) + 0.5) * np.pi / n, waves)
    down = np.concatenate([np.cos(angles) @ cosines.T, np.sin(angles) @ sines.T], axis=1)
    return down.astype(dtype), around.astype(dtype)


def _series(held: int) -> tuple[Array, Array]:
    """Return the matrices (12, k) from the coarse colatitudes to amplitudes k <= `held` of cosines and of sines."""
    # `spectra.spectrum` as sums: these few lines are no reason to import scipy.fft
    angles = np.outer(colatitudes(COARSE), np.arange(held + 1))
    cosines, sines = np.cos(angles), np.sin(angles)
    cosines[:, 0] /= 2
    if held == COARSE:
        cosines[:, COARSE] = 0  # the lattice does not hold it
        sines[:, COARSE] /= 2
    return cosines * (2 / COARSE), sines * (2 / COARSE)


@lru_cache(maxsize=1)
def _to_poles() -> Array:
    """Return the matrix (12 * 24, 2) from the coarse lattice to the poles: only means over the azimuth count there."""
    cosines = _series(COARSE)[0] / (2 * COARSE)
    ends = np.stack([cosines.sum(axis=1), cosines @ (-1.0) ** np.arange(COARSE + 1)], axis=1)
    return np.repeat(ends, 2 * COARSE, axis=0)


@lru_cache(maxsize=16)
def _low_lines(n: int, top: int, height: int, dtype: str) -> Array:
    """Return the matrix from harmonics below `LOWEST` (m, l, part) to lines (colatitude, m, part) of a patch."""
    shapes = legendre(harmonics.LOWEST - 1, n)[..., top : top + height]
    both = np.einsum("mlt,mn,pq->mlptnq", shapes, np.eye(harmonics.LOWEST), np.eye(2))
    found: Array = both.reshape(2 * harmonics.LOWEST**2, -1).astype(dtype)
    return found
