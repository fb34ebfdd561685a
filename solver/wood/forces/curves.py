"""The curves that bonds hold on to (`model.curves`), for the edges of a part, and what pulls on them.

A curve is linear in the edges, but for the clamps' directions; `uncurve` is the transpose of its derivative: so linear
and angular momentum are kept to round-off.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import CURVE

__all__ = ["ON_CURVE", "curve", "uncurve"]

#: Rows of a part's edges, see `rods`: tangent, inverse length, force on the edge; the edge, p, q, forces on them.
_T, _INVERSE, _FORCE, _E, _P, _Q, ON_CURVE = 6, 10, 11, 20, 23, 26, 29


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


@njit(cache=True, error_model="numpy")
def _clamped(n: int, m: int, along: float, on: int, row: np.ndarray) -> None:
    """Add what pulls on p or q of edge n, in three rows from `on`, by the direction g of its clamp's ghost edge m."""
    part, pull = 0.0, 0.0
    for c in range(3):
        part += along * row[_T + c, m] * row[_E + c, n]
        pull += along * row[_T + c, m] * row[on + c, n]
    for c in range(3):
        g = row[_T + c, m]
        row[_FORCE + c, n] += pull * g
        # (g.e) f + (g.f) e, but for what lies along g
        row[_FORCE + c, m] += row[_INVERSE, m] * (
            part * row[on + c, n] + pull * row[_E + c, n] - 2.0 * pull * part / along * g
        )


@njit(cache=True, error_model="numpy")
def uncurve(count: int, law: np.ndarray, row: np.ndarray) -> None:
    """Add the forces on p and q of `count` edges to those on the edges [N]."""
    for c in range(3):
        for n in range(count):
            p = row[ON_CURVE + c, n]
            q = row[ON_CURVE + 3 + c, n]
            row[ON_CURVE + c, n] = p - law[CURVE + 7, n] * q
            row[ON_CURVE + 3 + c, n] = q - law[CURVE + 3, n] * p
    for c in range(3):
        for n in range(count):
            row[_FORCE + c, n] += (
                law[CURVE + 1, n] * row[ON_CURVE + c, n] + law[CURVE + 5, n] * row[ON_CURVE + 3 + c, n]
            )
        for n in range(1, count):
            row[_FORCE + c, n - 1] += law[CURVE, n] * row[ON_CURVE + c, n]
        for n in range(count - 1):
            row[_FORCE + c, n + 1] += law[CURVE + 4, n] * row[ON_CURVE + 3 + c, n]
    for n in range(count):
        if law[CURVE + 2, n] != 0.0:
            _clamped(n, n - 1, law[CURVE + 2, n], ON_CURVE, row)
        if law[CURVE + 6, n] != 0.0:
            _clamped(n, n + 1, law[CURVE + 6, n], ON_CURVE + 3, row)
