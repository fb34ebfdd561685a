"""env: give every place the local amplitude of the wrinkles that its samples have there.

Where samples happen to agree their mean is strong, where they cancel it is faint, and the eye sees patches. The
envelope (rms amplitude in a window of 20 degrees) of the mean is brought to the mean of the samples' envelopes by a
smooth factor on the wrinkles; the shape of the fruit keeps its own.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.fruit import azimuths, colatitudes

from .. import harmonics, window
from ..harmonics import legendre
from ..window import Patch
from .cells import COARSE

__all__ = ["apply", "factor", "take_low"]

Array = NDArray[Any]

#: Share of the mean square below which a place counts as smooth, and the power [r1^2] of nothing.
_FAINT, _NOTHING = 1e-2, 1e-10
_MOST = 3.0


def factor(mean: Array, wanted: Array, total: float | None = None) -> Array:
    """Return the spectrum (m, k) of the factor on the wrinkles.

    `mean` (places,) is the local mean square of the weighted mean, `wanted` the local amplitude it should have. With
    a `total` (mean square) both are scaled to it first: power has been settled, only its places are left to.
    """
    area = np.repeat(harmonics.area(COARSE), 2 * COARSE)
    mean, wanted = np.maximum(mean, 0), wanted**2
    if total is not None:
        mean, wanted = (field * (total / (area @ field + _NOTHING)) for field in (mean, wanted))
    least = _FAINT * (area @ wanted) + _NOTHING
    ratio = np.sqrt((wanted + least) / (mean + least))
    along, cosines, sines = _analysis()
    lines = (np.minimum(np.maximum(ratio, 1 / _MOST), _MOST).reshape(COARSE, -1) @ along).reshape(COARSE, -1, 2)
    found = np.empty((COARSE + 1, 2, COARSE + 1))
    for first, down in ((0, cosines), (1, sines)):
        rows = lines[:, first::2].reshape(COARSE, -1)
        found[first::2] = (rows.T @ down).reshape(-1, 2, COARSE + 1)
    return found[:, 0] + 1j * found[:, 1]


def take_low(waves: Array, low: Array) -> None:
    """Subtract harmonics below `LOWEST`, `low` (3, m, l), from spectra (3, m, k)."""
    series = harmonics.low_series(waves.shape[-1] - 1)
    waves[:, : harmonics.LOWEST] -= np.einsum("cml,mlk->cmk", low, series).astype(waves.dtype)


def apply(planes: Array, ratio: Array, low: Array, patch: Patch) -> None:
    """Multiply wrinkles (c, height, width) on a patch by the factor with spectrum `ratio`, and add `low` (3, m, l) of
    the patch's components: all in place.
    """
    planes *= _on_lattice(ratio, patch, planes.dtype)
    shapes = legendre(harmonics.LOWEST - 1, patch.n)[..., patch.rows]
    lines = np.ascontiguousarray(np.einsum("cml,mlt->ctm", low[list(patch.components)], shapes))
    sides = lines.view(float).astype(planes.dtype)
    planes += sides @ window.around(patch.n, harmonics.LOWEST, patch.left, patch.width, planes.dtype.str)


def _on_lattice(ratio: Array, patch: Patch, kind: np.dtype[Any]) -> Array:
    """Sum a spectrum (m, k) on a patch (height, width): so few waves are cheaper by matrices than by transforms."""
    held = min(len(ratio), patch.n + 1)
    parts = ratio[:held, :held].T.copy().view(float).reshape(held, held, 2).astype(kind)
    lines = np.empty((patch.height, held, 2), kind)
    for first, matrix in enumerate(window.down(patch.n, held, patch.top, patch.height, kind.str)):
        lines[:, first::2] = (matrix.T @ parts[:, first::2].reshape(held, -1)).reshape(patch.height, -1, 2)
    return lines.reshape(patch.height, -1) @ window.around(patch.n, held, patch.left, patch.width, kind.str)


@lru_cache(maxsize=1)
def _analysis() -> tuple[Array, Array, Array]:
    """Return the matrices from the coarse lattice to spectra, cheaper than small transforms: from azimuths to parts of
    waves m (24, 2 m), and from colatitudes to amplitudes (12, k) of even and of odd m.
    """
    # `spectra.spectrum` as sums: these few lines are no reason to import scipy.fft
    n, waves = COARSE, np.arange(COARSE + 1)
    angles = np.outer(colatitudes(n), waves)
    cosines, sines = np.cos(angles), np.sin(angles)
    cosines[:, 0] /= 2
    cosines[:, n] = 0  # the lattice does not hold it
    sines[:, n] /= 2
    along = np.exp(-1j * np.outer(azimuths(n), waves)) / (2 * n)
    along[:, n] /= 2
    return along.view(float), cosines * (2 / n), sines * (2 / n)
