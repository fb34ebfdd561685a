"""The point of a triangle nearest to another one, from five dot products (Ericson 2005, sec. 5.1.5).

With the triangle a, b, c, its edges u = b - a and v = c - a and q = p - a, only u.u, u.v, v.v, u.q and v.q count: the
caller has its vectors in its own layout and precision, and all is done in that precision.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import njit

__all__ = ["on_triangle"]

Scalar: TypeAlias = np.floating[Any]

_ZERO, _ONE = np.float32(0), np.float32(1)
_TINY = np.float32(1e-30)
"""Keeps what has no size from dividing by 0: such a triangle is seen as one of its edges or corners."""


@njit(cache=True, error_model="numpy")
def on_triangle(uu: Scalar, uv: Scalar, vv: Scalar, uq: Scalar, vq: Scalar) -> tuple[Scalar, Scalar, bool]:
    """Return s, t of the point a + s u + t v of the triangle that is nearest to p, and whether it is in the inside.

    u.u, u.v, v.v, u.q, v.q: scalars, all of one precision. On the border the inside is False.
    """
    zero, one = uu * _ZERO, uu * _ZERO + _ONE  # of the caller's precision
    d3, d4 = uq - uu, vq - uv
    d5, d6 = uq - uv, vq - vv
    wa, wb, wc = d3 * d6 - d5 * d4, d5 * vq - uq * d6, uq * d4 - d3 * vq
    if uq <= 0 and vq <= 0:
        return zero, zero, False
    if d3 >= 0 and d4 <= d3:
        return one, zero, False
    if d6 >= 0 and d5 <= d6:
        return zero, one, False
    if wc <= 0 and uq >= 0 and d3 <= 0:
        return uq / (uq - d3 + _TINY), zero, False
    if wb <= 0 and vq >= 0 and d6 <= 0:
        return zero, vq / (vq - d6 + _TINY), False
    if wa <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6) + _TINY)
        return one - t, t, False
    inverse = one / (wa + wb + wc)
    return wb * inverse, wc * inverse, True
