"""Forces of the bonds: a transverse spring and a shear term, both balanced.

A bond joins its seat, the middle of an edge as laid, to a point of another rod, both on the curves through the rods'
vertices (`model.curves`). With d from the one point to the other and t the mean of the curves' slopes there, by arc
length at rest: E = k/2 (|d|/rest - 1)^2 rest + S (t.d/|d| - C0)^2, both times 1 - damage, but for pressure. At vertices
instead, shear is seen by slopes over two edges: too little of it, and a crack ends half an edge before its halves bend.
Sutherland 2012 has vertices, chords for curves, one rod's slope, and the cosine for t.d/|d|, which is the same but for
the edge's stretch (Eqs. 3.11-3.23). Put right: Eq. 3.15 has a wrong sign, 3.17 squares the energy, and 3.19-3.23 hold c
fixed, which loses momentum. Nothing is 0/0 at the rest angle.

The bonds of a part are rows of numbers, one lane a bond: what they read is copied to rows, the forces are computed from
rows to rows, which is vectorised, and the rows are added up. What did not help: one loop with gathers in it (it is not
vectorised), forces kept by bond and added up vertex by vertex, rods numbered along a curve of Hilbert's, fused
multiplication.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import COSINE, KEEP, LONG, RATE, SHARE, SHEAR, SPRING

__all__ = ["FORCES", "READS", "bind", "bound", "gather", "parts"]

_TINY = 1e-30
#: Rows that a bond reads: its seat, the other edge's first end, this edge, p and q, the slope at the seat; and rows of
#: its forces: on the seat, the slopes, p, q and the edge.
READS, FORCES = 18, 15
#: Lanes that an edge's numbers are written to at once; rows have as many to spare.
_WIDE = 4


@njit(cache=True, error_model="numpy", inline="always")
def _spread(row: np.ndarray, value: float) -> None:
    for q in range(_WIDE):
        row[q] = value


@njit(cache=True, error_model="numpy")
def gather(seats: np.ndarray, seat: np.ndarray, lane: np.ndarray, edge: np.ndarray, row: np.ndarray) -> None:
    """Fill the rows (18, w + 4) of bonds: their seats' places, first ends, edges, p, q and slopes at the seats.

    seats (s, 8): places and slopes; seat (w,), lane (m + 1,): as in `Plan`; edge: rows of the part's edges.
    """
    for n in range(lane[-1]):
        i = seat[n]
        row[0, n] = seats[i, 0]
        row[1, n] = seats[i, 1]
        row[2, n] = seats[i, 2]
        row[15, n] = seats[i, 3]
        row[16, n] = seats[i, 4]
        row[17, n] = seats[i, 5]
    _over(lane, edge, 0, row[3], row[4], row[5])
    _over(lane, edge, 20, row[6], row[7], row[8])
    _over(lane, edge, 23, row[9], row[10], row[11])
    _over(lane, edge, 26, row[12], row[13], row[14])


@njit(cache=True, error_model="numpy")
def _over(lane: np.ndarray, edge: np.ndarray, first: int, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> None:
    """Spread three rows of edges from `first` over the lanes of their bonds. More rows at once spill registers."""
    ex, ey, ez = edge[first], edge[first + 1], edge[first + 2]
    for q in range(len(lane) - 1):
        # lanes of the next edge are written over: cheaper than loops of some seven
        for n in range(int(lane[q]), int(lane[q + 1]), _WIDE):
            _spread(x[n:], ex[q])
            _spread(y[n:], ey[q])
            _spread(z[n:], ez[q])


@njit(cache=True, error_model="numpy")
def parts(u: float) -> tuple[float, float, float, float]:
    """Return the parts of p and q in the curve's place at u, and in its slope."""
    v = min(max(u, 0.0), 1.0)
    w = 1.0 - v
    # beyond its ends the curve goes straight on
    return v * w * w + min(u, 0.0), max(u - 1.0, 0.0) - v * v * w, w * (1.0 - 3.0 * v), v * (3.0 * v - 2.0)


@njit(cache=True, error_model="numpy")
def _reach(count: int, law: np.ndarray, row: np.ndarray) -> None:
    """Overwrite the rows 0 to 5 of bonds by d and t."""
    for n in range(count):
        u = law[SHARE, n]
        a, b, a1, b1 = parts(u)
        ex, ey, ez = row[6, n], row[7, n], row[8, n]
        px, py, pz = row[9, n], row[10, n], row[11, n]
        qx, qy, qz = row[12, n], row[13, n], row[14, n]
        row[0, n] = row[0, n] - row[3, n] - u * ex - a * px - b * qx
        row[1, n] = row[1, n] - row[4, n] - u * ey - a * py - b * qy
        row[2, n] = row[2, n] - row[5, n] - u * ez - a * pz - b * qz
        # both rods' slopes, each times the edge's length
        h = law[LONG, n]
        row[3, n] = ex + a1 * px + b1 * qx + h * row[15, n]
        row[4, n] = ey + a1 * py + b1 * qy + h * row[16, n]
        row[5, n] = ez + a1 * pz + b1 * qz + h * row[17, n]


@njit(cache=True, error_model="numpy")
def _pull(count: int, law: np.ndarray, row: np.ndarray, force: np.ndarray) -> None:
    """Write -dE/dd and -dE/dt of bonds to the rows 0 to 5 of force."""
    for n in range(count):
        dx, dy, dz = row[0, n], row[1, n], row[2, n]
        tx, ty, tz = row[3, n], row[4, n], row[5, n]
        d = np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        away = 1.0 / d
        dx *= away
        dy *= away
        dz *= away
        slope = tx * dx + ty * dy + tz * dz
        turn = law[KEEP, n] * law[SHEAR, n] * (slope - law[COSINE, n])
        shear = turn * away
        strain = d * law[RATE, n] - 1.0
        # what is damaged resists pressure as before
        stiff = law[KEEP, n] if strain > 0.0 else 1.0
        pull = -law[SPRING, n] * stiff * strain - shear * slope
        force[0, n] = pull * dx + shear * tx
        force[1, n] = pull * dy + shear * ty
        force[2, n] = pull * dz + shear * tz
        force[3, n] = turn * dx
        force[4, n] = turn * dy
        force[5, n] = turn * dz


@njit(cache=True, error_model="numpy")
def _share(count: int, law: np.ndarray, force: np.ndarray) -> None:
    """Write the forces on p and q to the rows 6 to 11, and on the edge to the rows 12 to 14."""
    for n in range(count):
        u = law[SHARE, n]
        a, b, a1, b1 = parts(u)
        fx, fy, fz = force[0, n], force[1, n], force[2, n]
        tx, ty, tz = force[3, n], force[4, n], force[5, n]
        force[12, n] = tx - u * fx
        force[13, n] = ty - u * fy
        force[14, n] = tz - u * fz
        force[6, n] = a1 * tx - a * fx
        force[7, n] = a1 * ty - a * fy
        force[8, n] = a1 * tz - a * fz
        force[9, n] = b1 * tx - b * fx
        force[10, n] = b1 * ty - b * fy
        force[11, n] = b1 * tz - b * fz


@njit(cache=True, error_model="numpy")
def bind(count: int, law: np.ndarray, row: np.ndarray, force: np.ndarray) -> None:
    """Write the forces (15, w) [N] of `count` bonds on seats and mean slopes, p, q and edges; first ends bear the rest.

    law (7, w): as in `Plan`; row: as `gather` leaves it; d and t are left in its rows 0 to 5. In three loops: where
    more rows are written than six, LLVM gives up asking which overlap, and nothing is vectorised. For the same reason
    no two arguments may be slices with steps.
    """
    _reach(count, law, row)
    _pull(count, law, row, force)
    _share(count, law, force)


@njit(cache=True, error_model="numpy")
def bound(count: int, law: np.ndarray, row: np.ndarray, own: np.ndarray) -> None:
    """Write the energies of `count` bonds to own (15, w) [J]: 0 what each has, 1 of opening and 2 of shear if whole.

    Other arguments as of `bind`, which must have been called.
    """
    for n in range(count):
        dx, dy, dz = row[0, n], row[1, n], row[2, n]
        d = np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        strain = d * law[RATE, n] - 1.0
        off = (row[3, n] * dx + row[4, n] * dy + row[5, n] * dz) / d - law[COSINE, n]
        keep = law[KEEP, n]
        straight = 0.5 * law[SPRING, n] * strain * strain / law[RATE, n]
        own[2, n] = -0.5 * law[SHEAR, n] * off * off
        own[1, n] = straight if strain > 0.0 else 0.0
        own[0, n] = straight * (keep if strain > 0.0 else 1.0) + keep * own[2, n]
