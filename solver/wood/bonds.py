"""Forces of the bonds: a transverse spring and a shear term, both balanced.

With d = x_i - c, c = (1 - share) y_j + share y_(j+1), e = y_(j+1) - y_j and C = e.d / (|e| |d|):
E = k/2 (|d|/rest - 1)^2 rest + S (C - C0)^2. Sutherland 2012, Eqs. 3.11-3.23, put right: Eq. 3.15 has a wrong sign,
3.17 squares the energy, and 3.19-3.23 hold c fixed, which loses momentum. Here nothing is 0/0 at the rest angle.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Bonds, Rods

__all__ = ["bind"]

_TINY = 1e-30


@njit(cache=True, error_model="numpy")
def bind(
    x: np.ndarray,
    f: np.ndarray,
    rods: Rods,
    bonds: Bonds,
    t: np.ndarray,
    inverse: np.ndarray,
    each: np.ndarray,
) -> float:
    """Add the bonds' forces to f (v, 3) [N] and write the energy of each (b,) [J]; return their sum [J].

    t (e, 3) and inverse (e,): unit vectors and 1/|e| of the edges, as `rods.stretch` leaves them.
    """
    energy = 0.0
    for n in range(len(bonds.i)):
        if bonds.on[n] == 0:
            each[n] = 0.0
            continue
        i = bonds.i[n]
        j = bonds.j[n]
        a = rods.a[j]
        b = rods.b[j]
        u = bonds.share[n]
        m = 1.0 - u
        dx = x[i, 0] - m * x[a, 0] - u * x[b, 0]
        dy = x[i, 1] - m * x[a, 1] - u * x[b, 1]
        dz = x[i, 2] - m * x[a, 2] - u * x[b, 2]
        tx = t[j, 0]
        ty = t[j, 1]
        tz = t[j, 2]
        # one root and two divisions: they are most of what a bond costs
        d2 = max(dx * dx + dy * dy + dz * dz, _TINY)
        away = 1.0 / np.sqrt(d2)
        strain = d2 * away / bonds.rest[n] - 1.0
        dx *= away
        dy *= away
        dz *= away
        cosine = tx * dx + ty * dy + tz * dz
        off = cosine - bonds.cosine[n]
        own = 0.5 * bonds.k[n] * strain * strain * bonds.rest[n] + bonds.s[n] * off * off
        each[n] = own
        energy += own
        w = -2.0 * bonds.s[n] * off
        q = -bonds.k[n] * strain - w * cosine * away
        w1 = w * away
        px = q * dx + w1 * tx  # -dE/dd
        py = q * dy + w1 * ty
        pz = q * dz + w1 * tz
        w *= inverse[j]
        rx = w * (dx - cosine * tx)  # -dE/de
        ry = w * (dy - cosine * ty)
        rz = w * (dz - cosine * tz)
        f[i, 0] += px
        f[i, 1] += py
        f[i, 2] += pz
        f[a, 0] -= m * px + rx
        f[a, 1] -= m * py + ry
        f[a, 2] -= m * pz + rz
        f[b, 0] -= u * px - rx
        f[b, 1] -= u * py - ry
        f[b, 2] -= u * pz - rz
    return energy
