"""Forces of stretching and bending, straight rest shapes: discrete elastic rods (Bergou et al. 2008).

Stretching: E = k/2 (|e|/rest - 1)^2 rest (Sutherland 2012, Eq. 3.9). Bending: E = alpha |kb|^2 / span with the
curvature binormal of unit tangents, |kb|^2 = 4 tan^2(phi/2); Eq. 3.3 has rest lengths in it, which is right only
for rods that do not stretch. Written with c = t0.t1 and 1 - c = |t1 - t0|^2 / 2, the forces need no cross product and
keep their digits at small angles.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Rods

__all__ = ["bend", "stretch"]

#: Keeps an edge of no length, and a hinge folded flat, finite.
_TINY = 1e-30
_FLAT = 1e-9


@njit(cache=True, error_model="numpy")
def stretch(x: np.ndarray, f: np.ndarray, rods: Rods, t: np.ndarray, inverse: np.ndarray) -> float:
    """Add the stretching forces to f (v, 3) [N]; fill tangents t (e, 3) and 1/|e| (e,); return the energy [J]."""
    energy = 0.0
    for e in range(len(rods.a)):
        if rods.alive[e] == 0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        ex = x[b, 0] - x[a, 0]
        ey = x[b, 1] - x[a, 1]
        ez = x[b, 2] - x[a, 2]
        length = np.sqrt(ex * ex + ey * ey + ez * ez)
        il = 1.0 / max(length, _TINY)
        inverse[e] = il
        ex *= il
        ey *= il
        ez *= il
        t[e, 0] = ex
        t[e, 1] = ey
        t[e, 2] = ez
        strain = length / rods.rest[e] - 1.0
        q = rods.k[e] * strain
        energy += 0.5 * q * strain * rods.rest[e]
        f[a, 0] += q * ex
        f[a, 1] += q * ey
        f[a, 2] += q * ez
        f[b, 0] -= q * ex
        f[b, 1] -= q * ey
        f[b, 2] -= q * ez
    return energy


@njit(cache=True, error_model="numpy")
def bend(f: np.ndarray, rods: Rods, t: np.ndarray, inverse: np.ndarray) -> float:
    """Add the bending forces to f (v, 3) [N]; return the energy [J]."""
    energy = 0.0
    for h in range(len(rods.before)):
        if rods.whole[h] == 0:
            continue
        p = rods.before[h]
        q = rods.after[h]
        ux = t[p, 0]
        uy = t[p, 1]
        uz = t[p, 2]
        wx = t[q, 0]
        wy = t[q, 1]
        wz = t[q, 2]
        dx = wx - ux
        dy = wy - uy
        dz = wz - uz
        less = 0.5 * (dx * dx + dy * dy + dz * dz)  # 1 - c
        more = max(2.0 - less, _FLAT)  # 1 + c
        stiff = 4.0 * rods.alpha[h] / rods.span[h]
        energy += stiff * less / more
        g = 2.0 * stiff / (more * more)
        gp = g * inverse[p]
        gq = g * inverse[q]
        # -dE/de of both edges: the parts of the other tangent across one's own
        px = gp * (dx + less * ux)
        py = gp * (dy + less * uy)
        pz = gp * (dz + less * uz)
        qx = gq * (less * wx - dx)
        qy = gq * (less * wy - dy)
        qz = gq * (less * wz - dz)
        a = rods.a[p]
        m = rods.a[q]
        b = rods.b[q]
        f[a, 0] -= px
        f[a, 1] -= py
        f[a, 2] -= pz
        f[m, 0] += px - qx
        f[m, 1] += py - qy
        f[m, 2] += pz - qz
        f[b, 0] += qx
        f[b, 1] += qy
        f[b, 2] += qz
    return energy
