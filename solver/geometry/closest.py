"""The points of two simple bodies that are closest to each other."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import njit

from ..arrays import Floats

__all__ = ["of_products", "of_segments", "on_triangle"]

Scalar: TypeAlias = np.floating[Any]

_TINY = 1e-30
_ZERO, _ONE = np.float32(0), np.float32(1)
_SMALL = np.float32(1e-30)
"""Keeps what has no size from dividing by 0, without making doubles of singles."""


@njit(cache=True, error_model="numpy")
def of_products(uu: Scalar, uv: Scalar, vv: Scalar, uq: Scalar, vq: Scalar) -> tuple[Scalar, Scalar, bool]:
    """Return s, t of the point a + s u + t v of a triangle nearest to p, and whether it is off the borders.

    u = b - a, v = c - a and q = p - a come as their scalar products, in any layout and precision: it is kept (Ericson
    2005, sec. 5.1.5).
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
        return uq / (uq - d3 + _SMALL), zero, False
    if wb <= 0 and vq >= 0 and d6 <= 0:
        return zero, vq / (vq - d6 + _SMALL), False
    if wa <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6) + _SMALL)
        return one - t, t, False
    inverse = one / (wa + wb + wc)
    return wb * inverse, wc * inverse, True


@njit(cache=True, error_model="numpy")
def on_triangle(p: Floats, a: Floats, b: Floats, c: Floats, weights: Floats) -> float:
    """Write the weights of the point of triangle a b c nearest to p, and return its squared distance."""
    ab, ac, ap = b - a, c - a, p - a
    v, w, _ = of_products(np.dot(ab, ab), np.dot(ab, ac), np.dot(ac, ac), np.dot(ab, ap), np.dot(ac, ap))
    weights[0], weights[1], weights[2] = 1 - v - w, v, w
    gap = p - (a + v * ab + w * ac)
    found: float = np.dot(gap, gap)
    return found


@njit(cache=True, error_model="numpy")
def of_segments(x: Floats, a: int, b: int, c: int, d: int, middle: float) -> tuple[float, float]:
    """Return where the segments a-b and c-d of points x (n, 3) are closest, each 0 to 1 (Ericson 2005, sec. 5.1.9).

    middle [m2]: weight of (s - 1/2)^2 + (t - 1/2)^2; with it they are segments in five dimensions.
    """
    p = middle
    q = middle
    e = 0.0
    f = -0.5 * middle
    g = 0.5 * middle
    for k in range(3):
        u = x[b, k] - x[a, k]
        v = x[d, k] - x[c, k]
        r = x[a, k] - x[c, k]
        p += u * u
        q += v * v
        e += u * v
        f += u * r
        g += v * r
    det = p * q - e * e
    s = 0.5
    if det > 1e-9 * p * q:
        s = min(max((e * g - f * q) / det, 0.0), 1.0)
    t = (e * s + g) / max(q, _TINY)
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((e * t - f) / max(p, _TINY), 0.0), 1.0)
    return s, t
