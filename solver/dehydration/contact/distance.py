"""How far a node is from a triangle and an edge from an edge, which points are nearest, and how far two nodes came.

Squared distances to a triangle are continuously differentiable, so forces along them are continuous. Those between
edges are so but where both are parallel, and there, and where the nearest point is an end, the pair counts for nothing:
nodes and triangles see the same distance then.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Singles
from ...geometry.closest import of_products
from .data import INLINE, Single

__all__ = ["edge_edge", "gone", "node_triangle"]

PARALLEL, FLAT = np.float32(2e-3), np.float32(1e-4)
"""Squared sines between two edges below which their pair begins to fade out (2.6 degrees) and counts for nothing.

Below that their common normal has no digits left.
"""
END = np.float32(0.05)
"""Share of an edge next to its end within which the pair fades out."""
ZERO, ONE, TINY = np.float32(0), np.float32(1), np.float32(1e-30)


@njit(**INLINE)
def node_triangle(x: Singles, p: int, a: int, b: int, c: int, out: Singles) -> Single:
    """Return the distance of node p from the triangle a, b, c (rows of x).

    out (8,): shares of the four nodes in the vector from foot to node, its direction, the distance.
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    qx, qy, qz = x[p, 0] - x[a, 0], x[p, 1] - x[a, 1], x[p, 2] - x[a, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    s, t, inside = of_products(uu, uv, vv, ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz)
    out[0], out[1], out[2], out[3] = ONE, s + t - ONE, -s, -t
    if inside:
        # the normal has more digits than the way from a foot that is near
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        inverse = ONE / np.sqrt(nx * nx + ny * ny + nz * nz + TINY)
        distance = (qx * nx + qy * ny + qz * nz) * inverse
        if distance < 0:
            inverse, distance = -inverse, -distance
    else:
        nx, ny, nz = qx - s * ux - t * vx, qy - s * uy - t * vy, qz - s * uz - t * vz
        distance = np.sqrt(nx * nx + ny * ny + nz * nz)
        inverse = ONE / (distance + TINY)
    out[4], out[5], out[6], out[7] = nx * inverse, ny * inverse, nz * inverse, distance
    found: Single = distance
    return found


@njit(**INLINE)
def edge_edge(x: Singles, a: int, b: int, c: int, d: int, out: Singles) -> Single:
    """Return how much the pair of edges a b and c d (rows of x) counts: nothing if parallel or where an end is nearest.

    out: as in `node_triangle`, from the second edge to the first; the distance alone where the pair counts for nothing.
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    qx, qy, qz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    qu, qv = ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz
    square = uu * vv - uv * uv
    slanted = square / (uu * vv + TINY) - FLAT
    s, t = (uv * qv - qu * vv) / (square + TINY), (uu * qv - uv * qu) / (square + TINY)
    if s > 0 and s < ONE and t > 0 and t < ONE and slanted > 0:
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        inverse = ONE / np.sqrt(nx * nx + ny * ny + nz * nz + TINY)
        distance = (qx * nx + qy * ny + qz * nz) * inverse
        if distance < 0:
            inverse, distance = -inverse, -distance
        out[0], out[1], out[2], out[3] = ONE - s, s, t - ONE, -t
        out[4], out[5], out[6], out[7] = nx * inverse, ny * inverse, nz * inverse, distance
        return min(min(min(s, ONE - s), min(t, ONE - t)) / END, slanted / (PARALLEL - FLAT), ONE)
    s = min(max(s if square > 0 else ZERO, ZERO), ONE)
    t = (qv + s * uv) / (vv + TINY)
    if t < 0 or t > ONE:
        t = min(max(t, ZERO), ONE)
        s = min(max((t * uv - qu) / (uu + TINY), ZERO), ONE)
    nx, ny, nz = qx + s * ux - t * vx, qy + s * uy - t * vy, qz + s * uz - t * vz
    out[7] = np.sqrt(nx * nx + ny * ny + nz * nz)
    return ZERO


@njit(**INLINE)
def gone(now: Singles, then: Singles, i: int, j: int) -> Single:
    """Return the square of how far nodes i and j (rows) have moved, one as the other sees it."""
    x = (now[i, 0] - then[i, 0]) - (now[j, 0] - then[j, 0])
    y = (now[i, 1] - then[i, 1]) - (now[j, 1] - then[j, 1])
    z = (now[i, 2] - then[i, 2]) - (now[j, 2] - then[j, 2])
    square: Single = x * x + y * y + z * z
    return square
