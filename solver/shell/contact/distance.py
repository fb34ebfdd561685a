"""Squared distances of vertex and triangle, and of two edges, as stencils of four vertices.

A stencil's nearest points differ by D = sum of w_i x_i: weights (1, -a, -b, -c) for a vertex and a triangle, (1 - s, s,
t - 1, -t) for two edges. The first derivative of D.D is 2 w_i D whatever else; the second follows from how the nearest
points slide, by the implicit function theorem, in the parameters that are free.
"""

from __future__ import annotations

from numba import njit

from ...arrays import Floats, Ints

__all__ = ["EDGES", "FACE", "nearest", "slides"]

#: Kinds of stencils: vertex and triangle, edge and edge.
FACE, EDGES = 0, 1


@njit(cache=True, error_model="numpy")
def nearest(x: Floats, stencil: Ints, kind: int, weights: Floats, gap: Floats) -> float:
    """Write weights (4,) and D (3,) of a stencil's nearest points; return D.D."""
    if kind == FACE:
        _on_triangle(x[stencil[0]], x[stencil[1]], x[stencil[2]], x[stencil[3]], weights)
    else:
        _of_edges(x[stencil[0]], x[stencil[1]], x[stencil[2]], x[stencil[3]], weights)
    for d in range(3):
        gap[d] = (
            weights[0] * x[stencil[0], d]
            + weights[1] * x[stencil[1], d]
            + weights[2] * x[stencil[2], d]
            + weights[3] * x[stencil[3], d]
        )
    square: float = gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]
    return square


@njit(cache=True, error_model="numpy")
def _on_triangle(p: Floats, a: Floats, b: Floats, c: Floats, weights: Floats) -> None:
    """Ericson 2005, sec. 5.1.5, without arrays of its own: it runs millions of times."""
    uu = uv = vv = uq = vq = 0.0
    for d in range(3):
        u, v, q = b[d] - a[d], c[d] - a[d], p[d] - a[d]
        uu += u * u
        uv += u * v
        vv += v * v
        uq += u * q
        vq += v * q
    s = t = 0.0
    d3, d4, d5, d6 = uq - uu, vq - uv, uq - uv, vq - vv
    wa, wb, wc = d3 * d6 - d5 * d4, d5 * vq - uq * d6, uq * d4 - d3 * vq
    if uq <= 0 and vq <= 0:
        pass
    elif d3 >= 0 and d4 <= d3:
        s = 1.0
    elif d6 >= 0 and d5 <= d6:
        t = 1.0
    elif wc <= 0 and uq >= 0 and d3 <= 0:
        s = uq / (uq - d3)
    elif wb <= 0 and vq >= 0 and d6 <= 0:
        t = vq / (vq - d6)
    elif wa <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s = 1 - t
    else:
        whole = wa + wb + wc
        s, t = wb / whole, wc / whole
    weights[0], weights[1], weights[2], weights[3] = 1.0, s + t - 1.0, -s, -t


@njit(cache=True, error_model="numpy")
def _of_edges(a: Floats, b: Floats, c: Floats, e: Floats, weights: Floats) -> None:
    """Ericson 2005, sec. 5.1.9."""
    p = q = m = f = g = 0.0
    for d in range(3):
        u, v, r = b[d] - a[d], e[d] - c[d], a[d] - c[d]
        p += u * u
        q += v * v
        m += u * v
        f += u * r
        g += v * r
    det = p * q - m * m
    s = 0.5
    if det > 1e-14 * p * q:
        s = min(max((m * g - f * q) / det, 0.0), 1.0)
    t = (m * s + g) / q
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((m * t - f) / p, 0.0), 1.0)
    weights[0], weights[1], weights[2], weights[3] = 1 - s, s, t - 1, -t


@njit(cache=True, error_model="numpy")
def slides(kind: int, weights: Floats, ways: Floats) -> int:
    """Write how D changes with each free parameter: ways (2, 4), weights of the stencil's vertices; return how many."""
    ways[:] = 0.0
    if kind == EDGES:
        count = 0
        if 0.0 < weights[1] < 1.0:
            ways[0, 0], ways[0, 1] = -1.0, 1.0
            count = 1
        if 0.0 < -weights[3] < 1.0:
            ways[count, 2], ways[count, 3] = 1.0, -1.0
            count += 1
        return count
    first = second = -1
    for k in range(1, 4):
        if weights[k] < 0.0:
            if first < 0:
                first = k
            else:
                ways[0 if second < 0 else 1, first] = 1.0
                ways[0 if second < 0 else 1, k] = -1.0
                second = k
    if second < 0:
        return 0
    return 2 if weights[1] < 0 and weights[2] < 0 and weights[3] < 0 else 1
