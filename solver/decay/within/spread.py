"""Linear spreading with what comes in and goes out in proportion, by super-time-stepping.

    dy/dt = D lap y + gain - loss y

RKL2 (Meyer, Balsara and Aslam 2014) as in `fields.diffusion`, on all points. Gain and loss belong into the same
stages: split off, they would miss the balance of a thin skin between what dries it and what comes from below.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats
from ..fields.diffusion import Links, stages_for

__all__ = ["spread"]


def spread(y: Floats, links: Links, rate: float, gain: Floats, loss: Floats, stiffest: float, dt: float) -> Floats:
    """Return y (n) a time dt later. links: of a diffusivity of 1 among all points, with a spectral radius `stiffest`.

    rate: diffusivity [r1^2 per unit of dt]. gain, loss (n): per unit of dt.
    """
    stages = max(3, stages_for(dt, rate * stiffest + float(loss.max())))
    found = np.empty_like(y)
    _spread(y, links, rate, gain, loss, dt, stages, found)
    return found


@njit(cache=True)
def _slope(y: Floats, links: Links, rate: float, gain: Floats, loss: Floats, out: Floats) -> None:
    first, to, share = links
    for i in range(len(y)):
        total = 0.0
        for k in range(first[i], first[i + 1]):
            total += share[k] * (y[to[k]] - y[i])
        out[i] = rate * total + gain[i] - loss[i] * y[i]


@njit(cache=True)
def _spread(
    y: Floats, links: Links, rate: float, gain: Floats, loss: Floats, dt: float, stages: int, found: Floats
) -> None:
    count = len(y)
    slope0, slope = np.empty(count), np.empty(count)
    _slope(y, links, rate, gain, loss, slope0)
    w = 4.0 / (stages * stages + stages - 2.0)
    b0 = b1 = 1 / 3
    before, last = y.copy(), y + b1 * w * dt * slope0
    for j in range(2, stages + 1):
        b = 1 / 3 if j == 2 else (j * j + j - 2.0) / (2.0 * j * (j + 1))
        mu = (2.0 * j - 1) / j * b / b1
        nu = -(j - 1.0) / j * b / b0
        step = mu * w * dt
        lean = -(1 - b1) * step
        _slope(last, links, rate, gain, loss, slope)
        for i in range(count):
            before[i] = mu * last[i] + nu * before[i] + (1 - mu - nu) * y[i] + step * slope[i] + lean * slope0[i]
        before, last = last, before
        b0, b1 = b1, b
    found[:] = last
