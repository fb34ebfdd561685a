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
    """Write weights (4,) and D (3,) of a stencil's nearest points; return D.D.

    Number by number, without rows of arrays: it runs millions of times, and each row would be counted in and out.
    """
    i, j, k, m = stencil[0], stencil[1], stencil[2], stencil[3]
    ax, ay, az = x[i, 0], x[i, 1], x[i, 2]
    bx, by, bz = x[j, 0], x[j, 1], x[j, 2]
    cx, cy, cz = x[k, 0], x[k, 1], x[k, 2]
    ex, ey, ez = x[m, 0], x[m, 1], x[m, 2]
    if kind == FACE:
        s, t = _on_triangle(cx - bx, cy - by, cz - bz, ex - bx, ey - by, ez - bz, ax - bx, ay - by, az - bz)
        w, v, u, r = 1.0, s + t - 1.0, -s, -t
    else:
        s, t = _of_edges(bx - ax, by - ay, bz - az, ex - cx, ey - cy, ez - cz, ax - cx, ay - cy, az - cz)
        w, v, u, r = 1 - s, s, t - 1, -t
    weights[0], weights[1], weights[2], weights[3] = w, v, u, r
    dx = w * ax + v * bx + u * cx + r * ex
    dy = w * ay + v * by + u * cy + r * ey
    dz = w * az + v * bz + u * cz + r * ez
    gap[0], gap[1], gap[2] = dx, dy, dz
    square: float = dx * dx + dy * dy + dz * dz
    return square


@njit(cache=True, error_model="numpy")
def _on_triangle(
    ux: float, uy: float, uz: float, vx: float, vy: float, vz: float, qx: float, qy: float, qz: float
) -> tuple[float, float]:  # fmt: skip
    """Return the nearest point to q of a triangle with sides u, v, as shares of them (Ericson 2005, sec. 5.1.5)."""
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    uq, vq = ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz
    d3, d4, d5, d6 = uq - uu, vq - uv, uq - uv, vq - vv
    wa, wb, wc = d3 * d6 - d5 * d4, d5 * vq - uq * d6, uq * d4 - d3 * vq
    if uq <= 0 and vq <= 0:
        return 0.0, 0.0
    if d3 >= 0 and d4 <= d3:
        return 1.0, 0.0
    if d6 >= 0 and d5 <= d6:
        return 0.0, 1.0
    if wc <= 0 and uq >= 0 and d3 <= 0:
        return uq / (uq - d3), 0.0
    if wb <= 0 and vq >= 0 and d6 <= 0:
        return 0.0, vq / (vq - d6)
    if wa <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1 - t, t
    whole = wa + wb + wc
    return wb / whole, wc / whole


@njit(cache=True, error_model="numpy")
def _of_edges(
    ux: float, uy: float, uz: float, vx: float, vy: float, vz: float, rx: float, ry: float, rz: float
) -> tuple[float, float]:  # fmt: skip
    """Return where edges u and v, whose starts differ by r, are nearest, as shares (Ericson 2005, sec. 5.1.9)."""
    p, q, m = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
    f, g = ux * rx + uy * ry + uz * rz, vx * rx + vy * ry + vz * rz
    det = p * q - m * m
    s = 0.5
    if det > 1e-14 * p * q:
        s = min(max((m * g - f * q) / det, 0.0), 1.0)
    t = (m * s + g) / q
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((m * t - f) / p, 0.0), 1.0)
    return s, t


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
