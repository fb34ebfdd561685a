"""env: give every place the local amplitude of the wrinkles that its samples have there.

Where samples happen to agree their mean is strong, where they cancel it is faint, and the eye sees patches. The
envelope (rms amplitude in a window of 20 degrees) of the mean is brought to the mean of the samples' envelopes by a
smooth factor on the wrinkles; the shape of the fruit keeps its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import harmonics, spectra, transforms
from ..harmonics import legendre
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
    return spectra.spectrum(np.clip(ratio, 1 / _MOST, _MOST).reshape(COARSE, 2 * COARSE))


def take_low(waves: Array, low: Array) -> None:
    """Subtract harmonics below `LOWEST`, `low` (3, m, l), from spectra (3, m, k)."""
    series = harmonics.low_series(waves.shape[-1] - 1)
    waves[:, : harmonics.LOWEST] -= np.einsum("cml,mlk->cmk", low, series).astype(waves.dtype)


def apply(planes: Array, ratio: Array, low: Array) -> None:
    """Multiply wrinkles (3, n, 2n) by the factor with spectrum `ratio`, and add `low` (3, m, l): all in place."""
    n = planes.shape[1]
    with transforms.borrow(n, min(COARSE, n), 1, planes.dtype) as plan:
        spectra.fill(plan.coefficients, ratio[None].astype(plan.coefficients.dtype))
        planes *= plan.run()
    lines = np.einsum("cml,mlt->ctm", low, legendre(harmonics.LOWEST - 1, n))
    angle = np.outer(np.arange(harmonics.LOWEST), np.arange(2 * n) * np.pi / n)
    for c in range(3):
        row = lines[c].real @ _twice(np.cos(angle)) - lines[c].imag @ _twice(np.sin(angle))
        planes[c] += row.astype(planes.dtype)


def _twice(waves: Array) -> Array:
    waves[1:] *= 2
    return waves
