"""Forces of the bonds: a transverse spring and a shear term, both balanced.

With d = x_i - c, c = (1 - share) y_j + share y_(j+1), e = y_(j+1) - y_j and C = e.d / (|e| |d|):
E = k/2 (|d|/rest - 1)^2 rest + S (C - C0)^2. Sutherland 2012, Eqs. 3.11-3.23, put right: Eq. 3.15 has a wrong sign,
3.17 squares the energy, and 3.19-3.23 hold c fixed, which loses momentum. Here nothing is 0/0 at the rest angle.

The bonds of a part are rows of numbers, one lane a bond: what they read is copied to rows, the forces are computed from
rows to rows, which is vectorised, and the rows are added up. Measured (ns of CPU per bond, 200 rods; 2000): bond after
bond, straight to the vertices, 17.3; 18.3. `gather` 2.3; 2.9, `bind` 1.9; 3.2, adding up 1.8; 3.5; a look at energies
3.0; 3.9 more. What did not help: one loop with gathers in it (13: it is not vectorised), forces kept by bond and added
up vertex by vertex (1 more; 4 to 9 more), rods numbered along a curve of Hilbert's (within 5 %), fused multiplication.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import COSINE, RATE, SHARE, SHEAR, SPRING

__all__ = ["bind", "bound", "gather"]

_TINY = 1e-30
#: Lanes that an edge's numbers are written to at once; rows have as many to spare.
_WIDE = 8


@njit(cache=True, error_model="numpy", inline="always")
def _spread(row: np.ndarray, value: float) -> None:
    for q in range(_WIDE):
        row[q] = value


@njit(cache=True, error_model="numpy")
def gather(x: np.ndarray, vertex: np.ndarray, lane: np.ndarray, edge: np.ndarray, row: np.ndarray) -> None:
    """Fill the rows (11, w + 8) of bonds: their vertices' places, first ends, tangents, lengths and their inverses.

    vertex (w,), lane (m + 1,): as in `Plan`; edge: rows of the part's edges.
    """
    for n in range(lane[-1]):
        i = vertex[n]
        row[0, n] = x[i, 0]
        row[1, n] = x[i, 1]
        row[2, n] = x[i, 2]
    ax, ay, az = row[3], row[4], row[5]
    tx, ty, tz = row[6], row[7], row[8]
    length, inverse = row[9], row[10]
    for q in range(len(lane) - 1):
        # lanes of the next edge are written over: cheaper than loops of some seven
        for n in range(int(lane[q]), int(lane[q + 1]), _WIDE):
            _spread(ax[n:], edge[0, q])
            _spread(ay[n:], edge[1, q])
            _spread(az[n:], edge[2, q])
            _spread(tx[n:], edge[6, q])
            _spread(ty[n:], edge[7, q])
            _spread(tz[n:], edge[8, q])
            _spread(length[n:], edge[9, q])
            _spread(inverse[n:], edge[10, q])


@njit(cache=True, error_model="numpy")
def bind(count: int, law: np.ndarray, row: np.ndarray, force: np.ndarray) -> None:
    """Write the forces (6, w) [N] of `count` bonds: on their vertices, and on the second ends of their edges.

    law (5, w): as in `Plan`; row: as `gather` leaves it. The first ends bear what is left. No two arguments may be
    slices with steps: the loop would not be vectorised (12 ns instead of 2).
    """
    for n in range(count):
        tx = row[6, n]
        ty = row[7, n]
        tz = row[8, n]
        u = law[SHARE, n]
        way = u * row[9, n]
        dx = row[0, n] - row[3, n] - way * tx
        dy = row[1, n] - row[4, n] - way * ty
        dz = row[2, n] - row[5, n] - way * tz
        d = np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        away = 1.0 / d
        dx *= away
        dy *= away
        dz *= away
        cosine = tx * dx + ty * dy + tz * dz
        w = law[SHEAR, n] * (cosine - law[COSINE, n])
        q = -law[SPRING, n] * (d * law[RATE, n] - 1.0) - w * cosine * away
        w1 = w * away
        px = q * dx + w1 * tx  # -dE/dd
        py = q * dy + w1 * ty
        pz = q * dz + w1 * tz
        w *= row[10, n]
        force[0, n] = px
        force[1, n] = py
        force[2, n] = pz
        # dE/de: what the turning of the edge adds
        force[3, n] = w * (dx - cosine * tx) - u * px
        force[4, n] = w * (dy - cosine * ty) - u * py
        force[5, n] = w * (dz - cosine * tz) - u * pz


@njit(cache=True, error_model="numpy")
def bound(count: int, law: np.ndarray, row: np.ndarray, own: np.ndarray) -> None:
    """Write the energy (w,) [J] of each of `count` bonds; arguments as of `bind`."""
    for n in range(count):
        way = law[SHARE, n] * row[9, n]
        dx = row[0, n] - row[3, n] - way * row[6, n]
        dy = row[1, n] - row[4, n] - way * row[7, n]
        dz = row[2, n] - row[5, n] - way * row[8, n]
        d = np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        strain = d * law[RATE, n] - 1.0
        off = (row[6, n] * dx + row[7, n] * dy + row[8, n] * dz) / d - law[COSINE, n]
        own[n] = 0.5 * law[SPRING, n] * strain * strain / law[RATE, n] - 0.5 * law[SHEAR, n] * off * off
