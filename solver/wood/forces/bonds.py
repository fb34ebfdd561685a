"""Forces of the bonds: a transverse spring and a shear term, both balanced.

A bond joins a vertex x to the point c of a curve through another rod's vertices (`model.curves`). With d = x - c and t
the curve's slope by arc length at rest: E = k/2 (|d|/rest - 1)^2 rest + S (t.d/|d| - C0)^2. Sutherland 2012 has chords
for curves, and the cosine for t.d/|d|, which is the same but for the edge's stretch (Eqs. 3.11-3.23). Put right: Eq.
3.15 has a wrong sign, 3.17 squares the energy, and 3.19-3.23 hold c fixed, which loses momentum. Here nothing is 0/0 at
the rest angle.

The bonds of a part are rows of numbers, one lane a bond: what they read is copied to rows, the forces are computed from
rows to rows, which is vectorised, and the rows are added up. What did not help: one loop with gathers in it (it is not
vectorised), forces kept by bond and added up vertex by vertex, rods numbered along a curve of Hilbert's, fused
multiplication.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import COSINE, RATE, SHARE, SHEAR, SPRING

__all__ = ["FORCES", "READS", "bind", "bound", "gather"]

_TINY = 1e-30
#: Rows that a bond reads: its vertex, its edge's first end, the edge, p and q; and rows of its forces: on the vertex,
#: the edge, p and q.
READS, FORCES = 15, 12
#: Lanes that an edge's numbers are written to at once; rows have as many to spare.
_WIDE = 8


@njit(cache=True, error_model="numpy", inline="always")
def _spread(row: np.ndarray, value: float) -> None:
    for q in range(_WIDE):
        row[q] = value


@njit(cache=True, error_model="numpy")
def gather(x: np.ndarray, vertex: np.ndarray, lane: np.ndarray, edge: np.ndarray, row: np.ndarray) -> None:
    """Fill the rows (15, w + 8) of bonds: their vertices' places, first ends, edges, p and q.

    vertex (w,), lane (m + 1,): as in `Plan`; edge: rows of the part's edges.
    """
    for n in range(lane[-1]):
        i = vertex[n]
        row[0, n] = x[i, 0]
        row[1, n] = x[i, 1]
        row[2, n] = x[i, 2]
    ax, ay, az = row[3], row[4], row[5]
    ex, ey, ez = row[6], row[7], row[8]
    px, py, pz = row[9], row[10], row[11]
    qx, qy, qz = row[12], row[13], row[14]
    for q in range(len(lane) - 1):
        # lanes of the next edge are written over: cheaper than loops of some seven
        for n in range(int(lane[q]), int(lane[q + 1]), _WIDE):
            _spread(ax[n:], edge[0, q])
            _spread(ay[n:], edge[1, q])
            _spread(az[n:], edge[2, q])
            _spread(ex[n:], edge[20, q])
            _spread(ey[n:], edge[21, q])
            _spread(ez[n:], edge[22, q])
            _spread(px[n:], edge[23, q])
            _spread(py[n:], edge[24, q])
            _spread(pz[n:], edge[25, q])
            _spread(qx[n:], edge[26, q])
            _spread(qy[n:], edge[27, q])
            _spread(qz[n:], edge[28, q])


@njit(cache=True, error_model="numpy")
def bind(count: int, law: np.ndarray, row: np.ndarray, force: np.ndarray) -> None:
    """Write the forces (12, w) [N] of `count` bonds on their vertices, and on edges, p and q; first ends bear the rest.

    law (5, w): as in `Plan`; row: as `gather` leaves it. No two arguments may be slices with steps: the loop would not
    be vectorised.
    """
    for n in range(count):
        u = law[SHARE, n]
        v = min(max(u, 0.0), 1.0)
        w = 1.0 - v
        # beyond its ends the curve goes straight on
        a = v * w * w + min(u, 0.0)
        b = max(u - 1.0, 0.0) - v * v * w
        a1 = w * (1.0 - 3.0 * v)
        b1 = v * (3.0 * v - 2.0)
        ex, ey, ez = row[6, n], row[7, n], row[8, n]
        px, py, pz = row[9, n], row[10, n], row[11, n]
        qx, qy, qz = row[12, n], row[13, n], row[14, n]
        dx = row[0, n] - row[3, n] - u * ex - a * px - b * qx
        dy = row[1, n] - row[4, n] - u * ey - a * py - b * qy
        dz = row[2, n] - row[5, n] - u * ez - a * pz - b * qz
        tx = ex + a1 * px + b1 * qx
        ty = ey + a1 * py + b1 * qy
        tz = ez + a1 * pz + b1 * qz
        d = np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        away = 1.0 / d
        dx *= away
        dy *= away
        dz *= away
        slope = tx * dx + ty * dy + tz * dz
        turn = law[SHEAR, n] * (slope - law[COSINE, n])
        pull = -law[SPRING, n] * (d * law[RATE, n] - 1.0) - turn * slope * away
        shear = turn * away
        fx = pull * dx + shear * tx  # -dE/dd
        fy = pull * dy + shear * ty
        fz = pull * dz + shear * tz
        dx *= turn  # -dE/dt
        dy *= turn
        dz *= turn
        force[0, n] = fx
        force[1, n] = fy
        force[2, n] = fz
        force[3, n] = dx - u * fx
        force[4, n] = dy - u * fy
        force[5, n] = dz - u * fz
        force[6, n] = a1 * dx - a * fx
        force[7, n] = a1 * dy - a * fy
        force[8, n] = a1 * dz - a * fz
        force[9, n] = b1 * dx - b * fx
        force[10, n] = b1 * dy - b * fy
        force[11, n] = b1 * dz - b * fz


@njit(cache=True, error_model="numpy")
def bound(count: int, law: np.ndarray, row: np.ndarray, own: np.ndarray) -> None:
    """Write the energy (w,) [J] of each of `count` bonds; arguments as of `bind`."""
    for n in range(count):
        u = law[SHARE, n]
        v = min(max(u, 0.0), 1.0)
        w = 1.0 - v
        a = v * w * w + min(u, 0.0)
        b = max(u - 1.0, 0.0) - v * v * w
        a1 = w * (1.0 - 3.0 * v)
        b1 = v * (3.0 * v - 2.0)
        dx = row[0, n] - row[3, n] - u * row[6, n] - a * row[9, n] - b * row[12, n]
        dy = row[1, n] - row[4, n] - u * row[7, n] - a * row[10, n] - b * row[13, n]
        dz = row[2, n] - row[5, n] - u * row[8, n] - a * row[11, n] - b * row[14, n]
        tx = row[6, n] + a1 * row[9, n] + b1 * row[12, n]
        ty = row[7, n] + a1 * row[10, n] + b1 * row[13, n]
        tz = row[8, n] + a1 * row[11, n] + b1 * row[14, n]
        d = np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        strain = d * law[RATE, n] - 1.0
        off = (tx * dx + ty * dy + tz * dz) / d - law[COSINE, n]
        own[n] = 0.5 * law[SPRING, n] * strain * strain / law[RATE, n] - 0.5 * law[SHEAR, n] * off * off
