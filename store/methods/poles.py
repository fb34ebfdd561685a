"""What gains on waves must not do at the poles: there a wave of azimuthal wavenumber m has no room.

A harmonic of degree l and order m is negligible where sin(colatitude) < m / l. A gain by hypot(m, k) on a mode of the
double Fourier sphere knows nothing of that and smears waves into the pole, where they meet in a star. So what the
gains add is faded out there.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["highest_degree", "keep_off"]

Array = NDArray[np.generic]

#: Share of the power that the highest degree in use may leave out.
_REST = 1e-3
#: Where waves end and where they are whole, in multiples of sin(colatitude) = m / degree.
_NONE, _ALL = 0.6, 1.0


def highest_degree(power: NDArray[np.floating]) -> int:
    """Return the degree below which nearly all of the power (sample, stage, l) lies, at every sample and stage."""
    total = power.sum(axis=-1, keepdims=True)
    below = np.where(total > 0, np.cumsum(power, axis=-1) / np.where(total > 0, total, 1.0), 1.0)
    return int((below < 1 - _REST).sum(axis=-1).max()) + 1


def keep_off(waves: Array, degree: int) -> Array:
    """Return waves (c, m, k) of fields with nothing at latitudes where waves m of degrees up to `degree` cannot be."""
    count, band = len(waves), waves.shape[1] - 1
    rows = np.ascontiguousarray(waves.transpose(1, 2, 0)).view(waves.real.dtype).reshape(band + 1, band + 1, 2 * count)
    kept = np.matmul(_windows(band, degree, rows.dtype.str), rows)
    return np.ascontiguousarray(kept).view(waves.dtype).reshape(band + 1, band + 1, count).transpose(2, 0, 1)


@lru_cache(maxsize=16)
def _windows(band: int, degree: int, dtype: str) -> Array:
    """Return the windows as matrices (m, k, k) on cosine (even m) or sine (odd m) amplitudes."""
    n = 2 * (band + 1)
    colatitude = (np.arange(n) + 0.5) * np.pi / n
    waves = np.arange(band + 1)
    cosines, sines = np.cos(np.outer(colatitude, waves)), np.sin(np.outer(colatitude, waves))
    weight = np.where(waves == 0, 1 / n, 2 / n)
    result = np.empty((band + 1, band + 1, band + 1), dtype)
    for m in waves:
        room = np.sin(colatitude) * degree / max(m, 1)
        part = np.clip((room - _NONE) / (_ALL - _NONE), 0, 1) if m > 1 else np.ones(n)
        basis = sines if m % 2 else cosines
        result[m] = (weight[:, None] * basis.T) @ ((part * part * (3 - 2 * part))[:, None] * basis)
    result.flags.writeable = False
    return result
