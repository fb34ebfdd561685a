"""What gains on waves must not do at the poles: there a wave of azimuthal wavenumber m has no room.

A harmonic of degree l and order m is negligible where sin(colatitude) < m / l. A gain by hypot(m, k) on a mode of the
double Fourier sphere knows nothing of that and smears waves into the pole, where they meet in a star. So what the
gains add is faded out there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.arrays import Array

from ...kept import Kept
from ...surfaces import steps

__all__ = ["highest_degree", "multiply"]


#: Share of the power that the highest degree in use may leave out.
_REST = 1e-3
#: Where waves end and where they are whole, in multiples of sin(colatitude) = m / degree.
_NONE, _ALL = 0.6, 1.0
#: Bytes of windows that are kept over all tables: .1 MB at 32 colatitudes, .6 at 64, 4 at 128, and as long to make as
#: three look-ups. A scene asks for all fruits at several levels of detail.
_ROOM = 128 << 20


def highest_degree(power: NDArray[np.floating]) -> int:
    """Return the degree below which nearly all of the power (sample, stage, l) lies, at every sample and stage."""
    total = power.sum(axis=-1, keepdims=True)
    below = np.where(total > 0, np.cumsum(power, axis=-1) / np.where(total > 0, total, 1.0), 1.0)
    return int((below < 1 - _REST).sum(axis=-1).max()) + 1


def multiply(waves: Array, factor: Array, degree: int) -> None:
    """Multiply waves (c, m, k) by a factor (m, k), in place, and keep what that adds off the poles.

    Nothing is added at latitudes where waves m of degrees up to `degree` cannot be.
    """
    count, band = len(waves), waves.shape[1] - 1
    real = waves.real.dtype
    parts, way = waves.view(real).reshape(count, band + 1, band + 1, 2), steps.now()
    # a window is the same on both hemispheres, so even and odd k do not mix: half the products
    windows = _kept.get((band, degree, real.str), lambda: _windows(band, degree, real.str))
    rows = [np.empty((len(one), count, 2, one.shape[-1]), real) for one in windows]
    way.gather(parts, factor, rows[0], rows[1])
    lines = [
        (row.reshape(len(row), 2 * count, -1) @ one).reshape(row.shape) for row, one in zip(rows, windows, strict=True)
    ]
    way.scatter(parts, lines[0], lines[1])


def _windows(band: int, degree: int, dtype: str) -> tuple[Array, Array]:
    """Return the windows on cosine (even m) or sine (odd m) amplitudes, those of even k and those of odd k, each as
    matrices (m, k, k) from the right; the waves m beyond them have no room anywhere.
    """
    n = 2 * (band + 1)
    colatitude = (np.arange(n) + 0.5) * np.pi / n
    waves = np.arange(band + 1)
    cosines, sines = np.cos(np.outer(colatitude, waves)), np.sin(np.outer(colatitude, waves))
    weight = np.where(waves == 0, 1 / n, 2 / n)
    kept = min(band, int(degree / _NONE))
    even, odd = (np.empty((kept + 1, len(k), len(k)), dtype) for k in (waves[::2], waves[1::2]))
    for m in range(kept + 1):
        room = np.sin(colatitude) * degree / max(m, 1)
        part = np.clip((room - _NONE) / (_ALL - _NONE), 0, 1) if m > 1 else np.ones(n)
        basis = sines if m % 2 else cosines
        shape = (part * part * (3 - 2 * part))[:, None] * basis
        for first, windows in ((0, even), (1, odd)):
            # transposed: it acts on rows
            windows[m] = ((weight[:, None] * basis.T)[first::2] @ shape[:, first::2]).T
    even.flags.writeable = odd.flags.writeable = False
    return even, odd


_kept: Kept[tuple[int, int, str], tuple[Array, Array]] = Kept(_ROOM, lambda both: both[0].nbytes + both[1].nbytes)
