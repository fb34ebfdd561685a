"""How fast a front of an organism runs in the model's own units: a flat wave, solved once for its constants.

With densities over d2 and lengths over sqrt(m d2), m the motility, Eq. 2, 3 and 9 lose both; what is left of the
constants makes the speed of the wave. A day can then be given as many units of time as make a front as quick as it was
measured to be.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit

from .colony import Colony

__all__ = ["front"]

#: Cells, their width, the step, and where the wave is timed, all in scaled units.
_CELLS, _WIDTH = 480, 0.05
_STEP = 0.3 * _WIDTH**2 / 0.25
_FROM, _TO = 200, 400
_MOST = 4_000_000


@lru_cache(maxsize=64)
def front(colony: Colony) -> float:
    """Return the speed of a flat front in fresh flesh (n = 1), over sqrt(m d2), per unit of time; 0 if none runs."""
    constants = (colony.sigma2 * colony.f1, colony.f2, colony.sigma3, colony.a1, colony.a2, colony.theta)
    took = float(_timed(*constants, colony.d2))
    return (_TO - _FROM) * _WIDTH / took if took > 0 else 0.0


@njit(cache=True)
def _timed(consume: float, half: float, wither: float, a1: float, a2: float, theta: float, cap: float) -> float:
    """Return the time that the wave takes from one mark to the other; 0 if it does not arrive."""
    u, n, phi = np.zeros(_CELLS), np.ones(_CELLS), np.zeros(_CELLS)
    u[:40] = 1.0
    # reactions may be quicker than spreading
    dt = min(_STEP, 0.1 / (consume * max(theta, cap) + wither + 1e-12))
    began, last = -1.0, _CELLS - 1
    for step in range(_MOST):
        for i in range(_CELLS):
            x = min(u[i], 1.0)
            phi[i] = x * x * (0.5 - x / 3)
        for i in range(_CELLS):
            flow = 0.0
            if i > 0:
                flow += 2 * n[i] * n[i - 1] / max(n[i] + n[i - 1], 1e-300) * (phi[i - 1] - phi[i])
            if i < last:
                flow += 2 * n[i] * n[i + 1] / max(n[i] + n[i + 1], 1e-300) * (phi[i + 1] - phi[i])
            eaten = consume * n[i] * u[i] * cap / (1 + half * n[i])
            tired = wither / ((1 + u[i] * cap / a1) * (1 + n[i] / a2))
            # the flux is of this step's phi, so u may change in place
            u[i] += dt * (flow / _WIDTH**2 + theta * eaten / cap - tired * u[i])
            n[i] = max(n[i] - dt * eaten, 0.0)
        if began < 0 and u[_FROM] > 0.05:
            began = step * dt
        if u[_TO] > 0.05:
            return step * dt - began
    return 0.0
