"""How far a node is from a triangle and an edge from an edge, and which points are nearest.

Squared distances to a triangle are continuously differentiable, so forces along them are continuous. Those between
edges are so but where both are parallel, and there, and where the nearest point is an end, the pair counts for nothing:
nodes and triangles see the same distance then. Closest points: Ericson, Real-Time Collision Detection (2005), 5.1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Singles
from .data import OPTIONS, Single

__all__ = ["edge_edge", "node_triangle"]

PARALLEL = np.float32(2e-3)
"""Squared sine between two edges below which their pair fades out (2.6 degrees)."""
END = np.float32(0.05)
"""Share of an edge next to its end within which the pair fades out."""
ZERO, ONE = np.float32(0), np.float32(1)


@njit(**OPTIONS)
def node_triangle(
    x: Singles, p: int, a: int, b: int, c: int, side: int, out: Singles, inner: bool
) -> tuple[Single, int]:
    """Distance of node p from the triangle a, b, c (rows of x), and the side it is on.

    side: which one it was on before (1 outside, -1 inside, 0 unknown), out (8,): shares of the four nodes in
    the vector from foot to node, its direction, the gap; the gap is negative where the node has gone through.
    inner: take a side that is known without asking where the foot is. Returns the distance and the side: 0 where the
    foot is on the border.
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    qx, qy, qz = x[p, 0] - x[a, 0], x[p, 1] - x[a, 1], x[p, 2] - x[a, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    d1, d2 = ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz
    d3, d4 = d1 - uu, d2 - uv
    d5, d6 = d1 - uv, d2 - vv
    tiny = np.float32(1e-30)
    wa, wb, wc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    s = t = ZERO
    inside = False
    if d1 <= 0 and d2 <= 0:
        s = t = ZERO
    elif d3 >= 0 and d4 <= d3:
        s, t = ONE, ZERO
    elif d6 >= 0 and d5 <= d6:
        s, t = ZERO, ONE
    elif wc <= 0 and d1 >= 0 and d3 <= 0:
        s, t = d1 / (d1 - d3 + tiny), ZERO
    elif wb <= 0 and d2 >= 0 and d6 <= 0:
        s, t = ZERO, d2 / (d2 - d6 + tiny)
    elif wa <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6) + tiny)
        s = ONE - t
    else:
        inverse = ONE / (wa + wb + wc)
        s, t, inside = wb * inverse, wc * inverse, True
    out[0], out[1], out[2], out[3] = ONE, s + t - ONE, -s, -t
    if inside:
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        inverse = ONE / np.sqrt(nx * nx + ny * ny + nz * nz + tiny)
        height = (qx * nx + qy * ny + qz * nz) * inverse
        now = 1 if height >= 0 else -1
        if side == 0:
            side = now
        inverse *= side
        out[4], out[5], out[6], out[7] = nx * inverse, ny * inverse, nz * inverse, height * side
        return abs(height), side
    ex, ey, ez = qx - s * ux - t * vx, qy - s * uy - t * vy, qz - s * uz - t * vz
    distance = np.sqrt(ex * ex + ey * ey + ez * ez)
    inverse = ONE / (distance + tiny)
    out[4], out[5], out[6], out[7] = ex * inverse, ey * inverse, ez * inverse, distance
    return distance, side if inner else 0


@njit(**OPTIONS)
def edge_edge(x: Singles, a: int, b: int, c: int, d: int, side: int, out: Singles) -> tuple[Single, int, Single]:
    """Distance between the edges a b and c d (rows of x), the side of the first, and how much the pair counts.

    side: of c d's lines on which a b was before, along (b - a) x (d - c): 1, -1, or 0 unknown. out: as in
    `node_triangle`, from the second edge to the first. The weight is 0 at parallel edges and where an end is nearest;
    only what counts has a side.
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    qx, qy, qz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    qu, qv = ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz
    tiny = np.float32(1e-30)
    square = uu * vv - uv * uv
    s, t, weight = (uv * qv - qu * vv) / (square + tiny), (uu * qv - uv * qu) / (square + tiny), ZERO
    if s > 0 and s < ONE and t > 0 and t < ONE and square > 0:
        weight = min(min(min(s, ONE - s), min(t, ONE - t)) / END, square / (PARALLEL * uu * vv + tiny))
        weight = min(weight, ONE)
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        inverse = ONE / np.sqrt(nx * nx + ny * ny + nz * nz + tiny)
        height = (qx * nx + qy * ny + qz * nz) * inverse
        if side == 0:
            side = 1 if height >= 0 else -1
        inverse *= side
        out[0], out[1], out[2], out[3] = ONE - s, s, t - ONE, -t
        out[4], out[5], out[6], out[7] = nx * inverse, ny * inverse, nz * inverse, height * side
        return abs(height), side, weight
    # an end is nearest: how near is all that is asked then
    s = min(max(s if square > 0 else ZERO, ZERO), ONE)
    t = (qv + s * uv) / (vv + tiny)
    if t < 0 or t > ONE:
        t = min(max(t, ZERO), ONE)
        s = min(max((t * uv - qu) / (uu + tiny), ZERO), ONE)
    ex, ey, ez = qx + s * ux - t * vx, qy + s * uy - t * vy, qz + s * uz - t * vz
    return np.sqrt(ex * ex + ey * ey + ez * ez), 0, ZERO
