"""The barrier's energy, gradient and second derivative over stencils that may touch.

Energy of a stencil nearer than its reach r: k r m B(d / r), B(u) = -(1 - u)^2 log u, which is twice differentiable
and grows without bound as d goes to 0. m is 1 for a vertex and a triangle; for two edges it falls to 0 where they
become parallel, for there the nearest points jump; what is near then is a vertex of theirs.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from .distance import EDGES, nearest, slides

__all__ = ["barrier", "barrier_diagonal", "barrier_hessian"]

#: Square of the sine of the angle below which edges count as about parallel.
_PARALLEL = 1e-3


@njit(cache=True, error_model="numpy")
def _shape(square: float, reach: float, found: Floats) -> None:
    """Write r B and its first two derivatives by the squared distance."""
    d = np.sqrt(square)
    u = d / reach
    log = np.log(u)
    first = 2 * (1 - u) * log - (1 - u) ** 2 / u
    second = -2 * log + 4 * (1 - u) / u + ((1 - u) / u) ** 2
    found[0] = -reach * (1 - u) ** 2 * log
    found[1] = first / (2 * d)
    found[2] = second / (4 * square * reach) - first / (4 * square * d)


@njit(cache=True, error_model="numpy")
def _parallel(x: Floats, stencil: Ints, found: Floats, ways: Floats) -> bool:
    """Write m and its first two derivatives by c = |u x v|^2, and u, v; return whether m is below 1."""
    uu = uv = vv = 0.0
    for d in range(3):
        ways[0, d] = x[stencil[1], d] - x[stencil[0], d]
        ways[1, d] = x[stencil[3], d] - x[stencil[2], d]
        uu += ways[0, d] * ways[0, d]
        uv += ways[0, d] * ways[1, d]
        vv += ways[1, d] * ways[1, d]
    c = uu * vv - uv * uv
    # of the lengths as they are: the derivatives of this bound are left out where m is 1, else they count
    bound = _PARALLEL * uu * vv
    found[0], found[1], found[2] = 1.0, 0.0, 0.0
    if c >= bound:
        return False
    share = c / (uu * vv) / _PARALLEL
    found[0] = share * (2 - share)
    found[1] = (2 - 2 * share) / _PARALLEL
    found[2] = -2 / _PARALLEL**2
    return True


@njit(cache=True, error_model="numpy")
def _sine(ways: Floats, slope: Floats) -> None:
    """Write the gradient (4, 3) of the squared sine of the angle of two edges, q = 1 - uv^2 / (uu vv)."""
    uu = uv = vv = 0.0
    for d in range(3):
        uu += ways[0, d] * ways[0, d]
        uv += ways[0, d] * ways[1, d]
        vv += ways[1, d] * ways[1, d]
    for d in range(3):
        by_u = -2 * uv / (uu * vv) * (ways[1, d] - uv / uu * ways[0, d])
        by_v = -2 * uv / (uu * vv) * (ways[0, d] - uv / vv * ways[1, d])
        slope[0, d], slope[1, d], slope[2, d], slope[3, d] = -by_u, by_u, -by_v, by_v


@njit(cache=True, error_model="numpy")
def _sine_bend(ways: Floats, bend: Floats) -> None:
    """Write the second derivative (2, 2, 3, 3) of the squared sine by both edges."""
    a = np.sqrt(ways[0, 0] ** 2 + ways[0, 1] ** 2 + ways[0, 2] ** 2)
    b = np.sqrt(ways[1, 0] ** 2 + ways[1, 1] ** 2 + ways[1, 2] ** 2)
    cosine = (ways[0, 0] * ways[1, 0] + ways[0, 1] * ways[1, 1] + ways[0, 2] * ways[1, 2]) / (a * b)
    for d in range(3):
        for h in range(3):
            u, v, one, two = ways[0, d] / a, ways[1, d] / b, ways[0, h] / a, ways[1, h] / b
            unit = 1.0 if d == h else 0.0
            # of the cosine p: its gradients are (v - p u) / a and (u - p v) / b for unit vectors u, v
            uu = (3 * cosine * u * one - u * two - v * one - cosine * unit) / a**2
            vv = (3 * cosine * v * two - v * one - u * two - cosine * unit) / b**2
            uv = (unit - u * one - v * two + cosine * u * two) / (a * b)
            bend[0, 0, d, h] = -2 * ((v - cosine * u) * (two - cosine * one) / a**2 + cosine * uu)
            bend[1, 1, d, h] = -2 * ((u - cosine * v) * (one - cosine * two) / b**2 + cosine * vv)
            bend[0, 1, d, h] = -2 * ((v - cosine * u) * (one - cosine * two) / (a * b) + cosine * uv)
            bend[1, 0, h, d] = bend[0, 1, d, h]


@njit(cache=True, error_model="numpy")
def barrier(x: Floats, stencils: Ints, kinds: Ints, reach: Floats, stiffness: Floats, gradient: Floats) -> float:
    """Return the energy of stencils (m, 4) at x (n, 3) and add its gradient to `gradient`.

    kinds (m,): `FACE` or `EDGES`. reach (m,) and stiffness (m,) [energy over length] of each. Infinite in touch.
    """
    energy = 0.0
    w, gap, b, m = np.empty(4), np.empty(3), np.empty(3), np.empty(3)
    ways, slope = np.empty((2, 3)), np.empty((4, 3))
    for k in range(len(stencils)):
        q = stencils[k]
        square = nearest(x, q, kinds[k], w, gap)
        if square >= reach[k] * reach[k]:
            continue
        if square <= 0.0:
            return np.inf
        _shape(square, reach[k], b)
        bent = kinds[k] == EDGES and _parallel(x, q, m, ways)
        share = m[0] if bent else 1.0
        energy += stiffness[k] * share * b[0]
        pull = 2 * stiffness[k] * share * b[1]
        for i in range(4):
            for d in range(3):
                gradient[q[i], d] += pull * w[i] * gap[d]
        if bent:
            _sine(ways, slope)
            for i in range(4):
                for d in range(3):
                    gradient[q[i], d] += stiffness[k] * b[0] * m[1] * slope[i, d]
    return energy


@njit(cache=True, error_model="numpy")
def barrier_diagonal(
    x: Floats, stencils: Ints, kinds: Ints, reach: Floats, stiffness: Floats, diagonal: Ints, blocks: Floats
) -> None:
    """Add the part of the second derivative along the gap, at each vertex, to blocks[diagonal] (n, 3, 3)."""
    w, gap, b, m = np.empty(4), np.empty(3), np.empty(3), np.empty(3)
    ways = np.empty((2, 3))
    for k in range(len(stencils)):
        q = stencils[k]
        square = nearest(x, q, kinds[k], w, gap)
        if square >= reach[k] * reach[k] or square <= 0.0:
            continue
        _shape(square, reach[k], b)
        share = m[0] if kinds[k] == EDGES and _parallel(x, q, m, ways) else 1.0
        hard = stiffness[k] * share * max(4 * b[2] + 2 * b[1] / square, 0.0)
        for i in range(4):
            one = hard * w[i] * w[i]
            for d in range(3):
                for h in range(3):
                    blocks[diagonal[q[i]], d, h] += one * gap[d] * gap[h]


@njit(cache=True, error_model="numpy")
def barrier_hessian(
    x: Floats, stencils: Ints, kinds: Ints, reach: Floats, stiffness: Floats, places: Ints, blocks: Floats
) -> None:
    """Add the second derivative of stencils to `blocks` (nnz, 3, 3); places (m, 16)."""
    w, gap, b, m = np.empty(4), np.empty(3), np.empty(3), np.empty(3)
    ways, slope, free = np.empty((2, 3)), np.zeros((4, 3)), np.empty((2, 4))
    bend = np.empty((2, 2, 3, 3))
    along, inverse, mixed = np.empty((2, 3)), np.empty((2, 2)), np.empty((2, 4, 3))
    for k in range(len(stencils)):
        q = stencils[k]
        square = nearest(x, q, kinds[k], w, gap)
        if square >= reach[k] * reach[k] or square <= 0.0:
            continue
        _shape(square, reach[k], b)
        bent = kinds[k] == EDGES and _parallel(x, q, m, ways)
        share = m[0] if bent else 1.0
        if bent:
            _sine(ways, slope)
            _sine_bend(ways, bend)
        count = slides(kinds[k], w, free)
        count = _sliding(x, q, w, gap, free, count, along, inverse, mixed)
        for i in range(4):
            for j in range(4):
                at = places[k, 4 * i + j]
                for d in range(3):
                    for h in range(3):
                        second = 2 * w[i] * w[j] if d == h else 0.0
                        for p in range(count):
                            for r in range(count):
                                second -= 2 * mixed[p, i, d] * inverse[p, r] * mixed[r, j, h]
                        one = 2 * w[i] * gap[d]
                        two = 2 * w[j] * gap[h]
                        value = share * (b[2] * one * two + b[1] * second)
                        if bent:
                            sign = 1.0 if i % 2 == j % 2 else -1.0
                            value += b[1] * m[1] * (one * slope[j, h] + slope[i, d] * two)
                            value += b[0] * m[2] * slope[i, d] * slope[j, h]
                            value += b[0] * m[1] * sign * bend[i // 2, j // 2, d, h]
                        blocks[at, d, h] += stiffness[k] * value


@njit(cache=True, error_model="numpy")
def _sliding(
    x: Floats, q: Ints, w: Floats, gap: Floats, free: Floats, count: int, along: Floats, inverse: Floats, mixed: Floats
) -> int:
    """Write E (p, 3), (E E^T)^-1 (p, p) and d(E D)/dx (p, 4, 3) of the free parameters; return how many to trust."""
    for p in range(count):
        for d in range(3):
            along[p, d] = 0.0
            for i in range(4):
                along[p, d] += free[p, i] * x[q[i], d]
        for i in range(4):
            for d in range(3):
                mixed[p, i, d] = along[p, d] * w[i] + gap[d] * free[p, i]
    aa = ab = bb = 0.0
    for d in range(3):
        if count > 0:
            aa += along[0, d] * along[0, d]
        if count > 1:
            ab += along[0, d] * along[1, d]
            bb += along[1, d] * along[1, d]
    if count == 1:
        inverse[0, 0] = 1 / aa
    if count == 2:
        det = aa * bb - ab * ab
        if det <= 1e-12 * aa * bb:
            inverse[0, 0] = 1 / aa
            return 1
        inverse[0, 0], inverse[1, 1] = bb / det, aa / det
        inverse[0, 1] = inverse[1, 0] = -ab / det
    return count
