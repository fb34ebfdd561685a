"""Which triangles are so near each other that they may come to cross or touch, and whether any of them do."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from ...geometry.boxes import LEAF, leaf_pairs, sort_boxes
from ...geometry.crossings import cross

__all__ = ["any_cross", "changed", "close_faces"]


def close_faces(x: Floats, triangles: Ints, reach: float) -> Ints:
    """Return the pairs (m, 2) of triangles without a common corner that are not shown to be `reach` apart."""
    low, high = _boxes(x, triangles, reach / 2)
    tree = sort_boxes(low, high)
    order = tree.order
    found = _close(x, triangles[order], low[order], high[order], leaf_pairs(tree), LEAF, reach)
    return order[found]


@njit(cache=True, error_model="numpy")
def any_cross(x: Floats, triangles: Ints, pairs: Ints) -> bool:
    """Return whether the triangles of any of the pairs (m, 2) cross at x (n, 3)."""
    p, q = np.empty((3, 3)), np.empty((3, 3))
    for m in range(len(pairs)):
        a, b = pairs[m]
        apart = False
        for d in range(3):
            for i in range(3):
                p[i, d], q[i, d] = x[triangles[a, i], d], x[triangles[b, i], d]
            apart = (
                apart
                or max(p[0, d], p[1, d], p[2, d]) < min(q[0, d], q[1, d], q[2, d])
                or max(q[0, d], q[1, d], q[2, d]) < min(p[0, d], p[1, d], p[2, d])
            )
        if not apart and cross(p, q):
            return True
    return False


@njit(cache=True, error_model="numpy")
def _boxes(x: Floats, triangles: Ints, wider: float) -> tuple[Floats, Floats]:
    """Return boxes about triangles, wider on all sides: least and largest coordinates, both (f, 3)."""
    low, high = np.empty((len(triangles), 3)), np.empty((len(triangles), 3))
    for t in range(len(triangles)):
        i, j, k = triangles[t]
        for d in range(3):
            low[t, d] = min(x[i, d], x[j, d], x[k, d]) - wider
            high[t, d] = max(x[i, d], x[j, d], x[k, d]) + wider
    return low, high


@njit(cache=True, error_model="numpy")
def _close(x: Floats, faces: Ints, low: Floats, high: Floats, leaves: Ints, leaf: int, reach: float) -> Ints:
    """Return the pairs (m, 2) of faces, in the leaves of a tree of their boxes, that `close_faces` returns.

    leaf: `LEAF`, handed in because numba's cache does not see when a constant of another file changes.
    """
    found, count = np.empty((1024, 2), np.int64), 0
    for pair in range(len(leaves)):
        first, second = leaves[pair, 0] * leaf, leaves[pair, 1] * leaf
        for a in range(first, min(first + leaf, len(faces))):
            # most of the time goes in here: compared without branches
            a0, a1, a2, b0, b1, b2 = low[a, 0], low[a, 1], low[a, 2], high[a, 0], high[a, 1], high[a, 2]
            for b in range(a + 1 if first == second else second, min(second + leaf, len(faces))):
                over = (a0 <= high[b, 0]) & (a1 <= high[b, 1]) & (a2 <= high[b, 2])
                over &= (low[b, 0] <= b0) & (low[b, 1] <= b1) & (low[b, 2] <= b2)
                if not over or _share(faces[a], faces[b]):
                    continue
                if _aside(x, faces[a], faces[b], reach) or _aside(x, faces[b], faces[a], reach):
                    continue
                if count == len(found):
                    found = np.concatenate((found, found))
                found[count, 0], found[count, 1] = a, b
                count += 1
    return found[:count].copy()


@njit(cache=True, error_model="numpy")
def _share(one: Ints, other: Ints) -> bool:
    """Return whether two triangles have a common corner."""
    shared = False
    for v in one:
        shared = shared or v in (other[0], other[1], other[2])
    return shared


@njit(cache=True, error_model="numpy")
def _aside(x: Floats, one: Ints, other: Ints, reach: float) -> bool:
    """Return whether a plane along one triangle, or upright on it along an edge, has the other `reach` beyond it."""
    i, j, k = one
    ux, uy, uz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    vx, vy, vz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = reach * np.sqrt(nx * nx + ny * ny + nz * nz)
    least, most = np.inf, -np.inf
    for w in other:
        height = nx * (x[w, 0] - x[i, 0]) + ny * (x[w, 1] - x[i, 1]) + nz * (x[w, 2] - x[i, 2])
        least, most = min(least, height), max(most, height)
    if least > size or most < -size:
        return True
    for side in range(3):
        a, b = one[side], one[(side + 1) % 3]
        ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        # outward, as the triangle turns
        ox, oy, oz = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
        least = np.inf
        for w in other:
            least = min(least, ox * (x[w, 0] - x[a, 0]) + oy * (x[w, 1] - x[a, 1]) + oz * (x[w, 2] - x[a, 2]))
        if least > reach * np.sqrt(ox * ox + oy * oy + oz * oz):
            return True
    return False


@njit(cache=True, error_model="numpy")
def changed(x: Floats, then: Floats, edges: Ints, lengths: Floats) -> float:
    """Return the largest change of an edge as a vector, turns included, from `then` to x (n, 3), over lengths (e,)."""
    most = 0.0
    for e in range(len(edges)):
        i, j = edges[e]
        square = 0.0
        for d in range(3):
            square += (x[i, d] - x[j, d] - then[i, d] + then[j, d]) ** 2
        most = max(most, square / lengths[e] ** 2)
    found: float = np.sqrt(most)
    return found
