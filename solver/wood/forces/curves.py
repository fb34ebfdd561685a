"""The curves that bonds hold on to (`model.curves`), for the edges of a part, and what pulls on them.

A curve is linear in the edges, but for the clamps' directions; `uncurve` is the transpose of its derivative: so linear
and angular momentum are kept to round-off.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import CURVE

__all__ = ["ON_CURVE", "curve", "uncurve"]

#: Rows of a part's edges, see `rods.ROWS`: tangent, inverse length, force on the edge; the edge, p, q, forces on them.
_T, _INVERSE, _FORCE, _E, _P, _Q, ON_CURVE = 6, 10, 11, 20, 23, 26, 29
#: Forces on the edges before and behind by their neighbours' curves.
_BEFORE, _BEHIND = 35, 38


@njit(cache=True, error_model="numpy", inline="always")
def _bow(first: int, last: int, side: int, made: int, out: int, law: np.ndarray, row: np.ndarray) -> None:
    """Write what an edge and its neighbour at `side` make of the curve to three rows from `out`."""
    for n in range(first, last):
        m = n + side
        ex, ey, ez = row[_E, n], row[_E + 1, n], row[_E + 2, n]
        gx, gy, gz = row[_T, m], row[_T + 1, m], row[_T + 2, m]
        beside = law[made, n]
        own = law[made + 1, n]
        along = law[made + 2, n] * (gx * ex + gy * ey + gz * ez)
        row[out, n] = beside * row[_E, m] + own * ex + along * gx
        row[out + 1, n] = beside * row[_E + 1, m] + own * ey + along * gy
        row[out + 2, n] = beside * row[_E + 2, m] + own * ez + along * gz


@njit(cache=True, error_model="numpy")
def curve(count: int, law: np.ndarray, row: np.ndarray) -> None:
    """Fill p and q of `count` edges; law (14, m): as `Plan.edge` has it."""
    for c in range(3):
        row[_P + c, 0] = 0.0
        row[_Q + c, count - 1] = 0.0
    _bow(1, count, -1, CURVE, _P, law, row)
    _bow(0, count - 1, 1, CURVE + 4, _Q, law, row)
    for c in range(3):
        for n in range(count):
            p = row[_P + c, n]
            q = row[_Q + c, n]
            row[_P + c, n] = p - law[CURVE + 3, n] * q
            row[_Q + c, n] = q - law[CURVE + 7, n] * p


@njit(cache=True, error_model="numpy", inline="always")
def _hand(first: int, last: int, side: int, made: int, on: int, to: int, law: np.ndarray, row: np.ndarray) -> None:
    """Hand the forces in three rows from `on` to their edges, and write those on the neighbours to rows from `to`."""
    for n in range(first, last):
        m = n + side
        ex, ey, ez = row[_E, n], row[_E + 1, n], row[_E + 2, n]
        gx, gy, gz = row[_T, m], row[_T + 1, m], row[_T + 2, m]
        fx, fy, fz = row[on, n], row[on + 1, n], row[on + 2, n]
        beside = law[made, n]
        own = law[made + 1, n]
        pull = law[made + 2, n] * (gx * fx + gy * fy + gz * fz)
        along = law[made + 2, n] * (gx * ex + gy * ey + gz * ez)
        row[_FORCE, n] += own * fx + pull * gx
        row[_FORCE + 1, n] += own * fy + pull * gy
        row[_FORCE + 2, n] += own * fz + pull * gz
        # a clamp's direction g: (g.e) f + (g.f) e, but for what lies along g
        less = 2.0 * pull * along
        turn = row[_INVERSE, m]
        row[to, n] = beside * fx + turn * (along * fx + pull * ex - less * gx)
        row[to + 1, n] = beside * fy + turn * (along * fy + pull * ey - less * gy)
        row[to + 2, n] = beside * fz + turn * (along * fz + pull * ez - less * gz)


@njit(cache=True, error_model="numpy")
def uncurve(count: int, law: np.ndarray, row: np.ndarray) -> None:
    """Add the forces on p and q of `count` edges to those on the edges [N]."""
    for c in range(3):
        for n in range(count):
            p = row[ON_CURVE + c, n]
            q = row[ON_CURVE + 3 + c, n]
            row[ON_CURVE + c, n] = p - law[CURVE + 7, n] * q
            row[ON_CURVE + 3 + c, n] = q - law[CURVE + 3, n] * p
    _hand(1, count, -1, CURVE, ON_CURVE, _BEFORE, law, row)
    _hand(0, count - 1, 1, CURVE + 4, ON_CURVE + 3, _BEHIND, law, row)
    for c in range(3):
        for n in range(1, count):
            row[_FORCE + c, n - 1] += row[_BEFORE + c, n]
        for n in range(count - 1):
            row[_FORCE + c, n + 1] += row[_BEHIND + c, n]
