"""The nearest point of a triangle mesh to each of many points, exactly, by a descent of the tree over its boxes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..arrays import Array, Floats, Ints
from .boxes import LEAF, Boxes, sort_boxes
from .closest import on_triangle

__all__ = ["Nearest", "Tree", "nearest", "tree_of"]


class Nearest(NamedTuple):
    """Where each point was bound: a triangle (p), shares of its corners (p, 3), and how far away it is (p)."""

    face: Ints
    shares: Floats
    distance: Floats


class Tree(NamedTuple):
    """A mesh's triangles, sorted: for those who ask again and again."""

    corners: Floats
    """(f, 3, 3) corners of the triangles"""
    boxes: Boxes

    def nearest(self, points: Array) -> Nearest:
        """Return the nearest point of the mesh for every point (p, 3)."""
        found = Nearest(np.zeros(len(points), np.int64), np.zeros((len(points), 3)), np.zeros(len(points)))
        here = np.ascontiguousarray(points, dtype=np.float64)
        _descend(here, self.corners, self.boxes.order, self.boxes.leaves, self.boxes.low, self.boxes.high, *found)
        return found


def tree_of(vertices: Array, faces: Array) -> Tree:
    """Return the triangles (f, 3) of vertices (v, 3), sorted."""
    corners = np.ascontiguousarray(vertices[faces], dtype=np.float64)
    return Tree(corners, sort_boxes(corners.min(axis=1), corners.max(axis=1)))


def nearest(points: Array, vertices: Array, faces: Array) -> Nearest:
    """Return the nearest point of a mesh (v, 3), (f, 3) for every point (p, 3)."""
    return tree_of(vertices, faces).nearest(points)


@njit(cache=True, error_model="numpy")
def _away(p: Floats, low: Floats, high: Floats) -> float:
    """Return the squared distance of a point from a box, infinite if it is empty."""
    total = 0.0
    for k in range(3):
        gap = max(low[k] - p[k], p[k] - high[k])
        if gap > 0:
            total += gap * gap
    return total


# without the GIL: a fine mesh takes 16 s, and a watchdog ends what was told to stop
@njit(cache=True, error_model="numpy", nogil=True)
def _descend(
    points: Floats,
    corners: Floats,
    order: Ints,
    leaves: int,
    low: Floats,
    high: Floats,
    face: Ints,
    shares: Floats,
    distance: Floats,
) -> None:
    stack, weights = np.empty(128, np.int64), np.empty(3)
    for i in range(len(points)):
        p, best = points[i], np.inf
        stack[0], depth = 0, 1
        while depth:
            depth -= 1
            node = stack[depth]
            if not _away(p, low[node], high[node]) < best:
                continue
            if node >= leaves - 1:
                first = (node - leaves + 1) * LEAF
                for place in range(first, min(first + LEAF, order.size)):
                    t = order[place]
                    far = on_triangle(p, corners[t, 0], corners[t, 1], corners[t, 2], weights)
                    if far < best:
                        best, face[i] = far, t
                        shares[i] = weights
                continue
            # the nearer child is opened first
            a, b = 2 * node + 1, 2 * node + 2
            if _away(p, low[a], high[a]) < _away(p, low[b], high[b]):
                a, b = b, a
            stack[depth], stack[depth + 1] = a, b
            depth += 2
        distance[i] = np.sqrt(best)
