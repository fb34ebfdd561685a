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
def bind(x: np.ndarray, f: np.ndarray, rods: Rods, bonds: Bonds, each: np.ndarray) -> float:
    """Add the bonds' forces to f (v, 3) [N] and write the energy of each (b,) [J]; return their sum [J]."""
    energy = 0.0
    for n in range(len(bonds.i)):
        if bonds.on[n] == 0:
            each[n] = 0.0
            continue
        i = bonds.i[n]
        a = rods.a[bonds.j[n]]
        b = rods.b[bonds.j[n]]
        u = bonds.share[n]
        m = 1.0 - u
        dx = x[i, 0] - m * x[a, 0] - u * x[b, 0]
        dy = x[i, 1] - m * x[a, 1] - u * x[b, 1]
        dz = x[i, 2] - m * x[a, 2] - u * x[b, 2]
        ex = x[b, 0] - x[a, 0]
        ey = x[b, 1] - x[a, 1]
        ez = x[b, 2] - x[a, 2]
        d2 = max(dx * dx + dy * dy + dz * dz, _TINY)
        e2 = max(ex * ex + ey * ey + ez * ez, _TINY)
        id2 = 1.0 / d2
        ie2 = 1.0 / e2
        d = np.sqrt(d2)
        ide = np.sqrt(id2 * ie2)
        cosine = (ex * dx + ey * dy + ez * dz) * ide
        strain = d / bonds.rest[n] - 1.0
        off = cosine - bonds.cosine[n]
        own = 0.5 * bonds.k[n] * strain * strain * bonds.rest[n] + bonds.s[n] * off * off
        each[n] = own
        energy += own
        w = -2.0 * bonds.s[n] * off
        q = -bonds.k[n] * strain / d - w * cosine * id2
        r = -w * cosine * ie2
        w *= ide
        px = q * dx + w * ex  # -dE/dd
        py = q * dy + w * ey
        pz = q * dz + w * ez
        rx = w * dx + r * ex  # -dE/de
        ry = w * dy + r * ey
        rz = w * dz + r * ez
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
