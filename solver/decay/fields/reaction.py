"""Reactions at a point, Eq. 2, 3, 7-9: nutrient n becomes active organism u, which becomes inactive v.

    dn/dt = -f          f = k n u / (1 + f2 n)                      (Michaelis-Menten)
    du/dt = theta f - a u      a = w / ((1 + u/a1) (1 + n/a2))      (Mimura, as Eq. 8 must read)
    dv/dt = a u

k = sigma2 f1 and w = sigma3, both per day. theta n + u + v is constant at every point. The modified Patankar scheme of
second order (Burchard, Deleersnijder and Meister 2003) keeps that to round-off and everything positive for any step.
"""

from __future__ import annotations

from numba import njit

from ...arrays import Floats, Ints
from .rates import Rates

__all__ = ["react"]


@njit(cache=True)
def react(u: Floats, v: Floats, n: Floats, listed: Ints, dt: float, rates: Rates) -> None:
    """Advance the listed vertices by dt [day] in place."""
    for i in listed:
        u0, n0 = u[i], n[i]
        if u0 <= 1e-200:
            continue
        eat0 = rates.consume * u0 / (1.0 + rates.half * n0)
        tire0 = rates.wither / ((1.0 + u0 / rates.a1) * (1.0 + n0 / rates.a2))
        n1 = n0 / (1.0 + dt * eat0)
        u1 = (u0 + dt * rates.theta * eat0 * n1) / (1.0 + dt * tire0)
        eat1 = rates.consume * u1 / (1.0 + rates.half * n1)
        tire1 = rates.wither / ((1.0 + u1 / rates.a1) * (1.0 + n1 / rates.a2))
        # mean of both ends' amounts, over the predicted source
        eat = 0.5 * (eat0 * n0 + eat1 * n1) / n1 if n1 > 1e-200 else 0.0
        tire = 0.5 * (tire0 * u0 + tire1 * u1) / u1
        n2 = n0 / (1.0 + dt * eat)
        u2 = (u0 + rates.theta * (n0 - n2)) / (1.0 + dt * tire)
        u[i], n[i] = u2, n2
        v[i] += u0 + rates.theta * (n0 - n2) - u2
