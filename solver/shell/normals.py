"""Unit normals of a surface's vertices, by the areas of the triangles about them."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints

__all__ = ["normals"]


def normals(x: Floats, triangles: Ints) -> Floats:
    """Return unit normals (n, 3) of vertices; of vertices without area the z axis."""
    found = np.zeros_like(x)
    _normals(x, triangles, found)
    return found


@njit(cache=True, error_model="numpy")
def _normals(x: Floats, triangles: Ints, found: Floats) -> None:
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        bx, by, bz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        for v in (i, j, k):
            found[v, 0] += ay * bz - az * by
            found[v, 1] += az * bx - ax * bz
            found[v, 2] += ax * by - ay * bx
    for v in range(len(found)):
        size = np.sqrt(found[v, 0] ** 2 + found[v, 1] ** 2 + found[v, 2] ** 2)
        if size > 0:
            for d in range(3):
                found[v, d] /= size
        else:
            found[v, 0], found[v, 1], found[v, 2] = 0.0, 0.0, 1.0
