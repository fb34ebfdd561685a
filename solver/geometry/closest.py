"""The points of two simple bodies that are closest to each other."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats

__all__ = ["of_segments", "on_triangle"]

_TINY = 1e-30


@njit(cache=True, error_model="numpy")
def on_triangle(p: Floats, a: Floats, b: Floats, c: Floats, weights: Floats) -> float:
    """Write the weights of the point of triangle a b c nearest to p, and return its squared distance (Ericson 2005)."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    bp, cp = p - b, p - c
    d3, d4, d5, d6 = np.dot(ab, bp), np.dot(ac, bp), np.dot(ab, cp), np.dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0 and d2 <= 0:
        v, w = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        v, w = d1 / (d1 - d3), 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
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
