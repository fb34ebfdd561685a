"""The stiffness of contacts with rigid bodies, vertex by vertex, for the implicit scheme."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Bodies
from .bodies import touch
from .moment import State

__all__ = ["RUBBING", "contacts"]

#: Slip at which friction has its full size [m/s].
RUBBING = 1e-3


@njit(cache=True, error_model="numpy")
def _contacts(
    x: np.ndarray,
    v: np.ndarray,
    bodies: Bodies,
    centre: np.ndarray,
    speed: np.ndarray,
    lagged: np.ndarray,
    dt: float,
    positive: bool,
    out: np.ndarray,
) -> None:
    n = np.zeros(3)
    s = np.zeros(3)
    for r in range(len(bodies.kind)):
        k = bodies.k[r]
        ease = bodies.ease[r]
        for i in range(len(x)):
            gap, bow, n[0], n[1], n[2] = touch(
                bodies.kind[r],
                bodies.axis[r],
                bodies.half[r],
                x[i, 0] - centre[r, 0],
                x[i, 1] - centre[r, 1],
                x[i, 2] - centre[r, 2],
            )
            if gap <= 0.0:
                continue
            stiff = k
            normal = k * (gap - 0.5 * ease)
            if gap < ease:
                stiff = k * gap / ease
                normal = 0.5 * stiff * gap
            sn = 0.0
            for c in range(3):
                s[c] = v[i, c] - speed[r, c]
                sn += s[c] * n[c]
            slip = 0.0
            for c in range(3):
                s[c] -= sn * n[c]
                slip += s[c] * s[c]
            slip = np.sqrt(slip)
            soft = min(slip / RUBBING, 1.0)
            drag = bodies.friction[r] * lagged[r, i] / dt
            secant = drag * (2.0 - soft) / max(slip, RUBBING)
            slope = drag * 2.0 * (1.0 - soft) / RUBBING
            if positive:
                # what only slides would be free to
                secant = drag / max(slip, 0.5 * RUBBING)
                slope = secant
            turn = 0.0 if positive or bow == 0.0 else normal / bow
            for p in range(3):
                for q in range(3):
                    one = 1.0 if p == q else 0.0
                    flat = one - n[p] * n[q]
                    out[i, p, q] += stiff * n[p] * n[q] + secant * flat
                    if slip > 0.0:
                        out[i, p, q] += (slope - secant) * s[p] * s[q] / (slip * slip)
                    if turn > 0.0 and p != bodies.axis[r] and q != bodies.axis[r]:
                        out[i, p, q] -= turn * flat


def contacts(state: State, dt: float, positive: bool) -> np.ndarray | None:
    """Return the stiffness (v, 3, 3) [N/m] of the contacts at the state's x and v; None without bodies.

    positive: as the factor needs it, without the body's curvature and the slope of friction.
    """
    m, s, bodies = state.wood.motion, state.scratch, state.wood.bodies
    if not len(bodies.kind):
        return None
    out = np.zeros((len(m.x), 3, 3))
    _contacts(m.x, m.v, bodies, s.centre, s.speed, s.lagged, dt, positive, out)
    out[m.held == 1] = 0.0
    return out
