"""Contact of a sheet with itself: vertices keep a distance from triangles that are not their neighbours.

Energy k A (d0 - d)^2 / 2 for each vertex nearer than d0 to a triangle (d to its nearest point, A the vertex's area);
twice differentiable almost everywhere, and without sides: a part that moves less than the distance between two looks
cannot pass. Edges against edges are left to their vertices, which holds where d0 is not far below an edge's length.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from ..arrays import Floats, Ints
from ..geometry.closest import on_triangle
from .topology import Topology

__all__ = ["candidates", "contact", "contact_diagonal"]


def candidates(x: Floats, mesh: Topology, distance: float, rings: int = 2) -> Ints:
    """Return pairs (m, 2) of vertex and triangle that may be nearer than `distance`, `rings` of neighbours left out."""
    t = mesh.triangles
    # points against points: a tree of boxes (`geometry.boxes`) takes 4 to 8 times as long
    centres = x[t].mean(axis=1)
    reach = float(np.linalg.norm(x[t] - centres[:, None], axis=-1).max())
    near = KDTree(x).sparse_distance_matrix(KDTree(centres), distance + reach, output_type="coo_matrix")
    i, j = mesh.edges.T
    n = mesh.vertices
    ones = np.ones(len(i), np.int32)
    graph = csr_matrix((ones, (i, j)), (n, n))
    graph = graph + graph.T + csr_matrix((np.ones(n, np.int32), (np.arange(n), np.arange(n))), (n, n))
    around = graph
    for _ in range(rings - 1):
        around = around @ graph
    corners = csr_matrix((np.ones(t.size, np.int32), (t.ravel(), np.repeat(np.arange(len(t)), 3))), (n, len(t)))
    own = (around @ corners).tocoo()
    count = len(t)
    pairs = np.sort(near.row.astype(np.int64) * count + near.col)
    keys = np.setdiff1d(pairs, own.row.astype(np.int64) * count + own.col, assume_unique=True)
    return np.stack([keys // count, keys % count], -1)


@njit(cache=True, error_model="numpy")
def contact(x: Floats, triangles: Ints, pairs: Ints, distance: float, stiffness: Floats, gradient: Floats) -> float:
    """Return the energy of contact and add its gradient to `gradient` (n, 3); stiffness (n,) of each vertex."""
    energy = 0.0
    weights = np.empty(3)
    for m in range(len(pairs)):
        v, t = pairs[m, 0], pairs[m, 1]
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        square = on_triangle(x[v], x[i], x[j], x[k], weights)
        if square >= distance * distance or square == 0:
            continue
        gap = np.sqrt(square)
        depth = distance - gap
        energy += 0.5 * stiffness[v] * depth * depth
        for d in range(3):
            way = x[v, d] - weights[0] * x[i, d] - weights[1] * x[j, d] - weights[2] * x[k, d]
            force = stiffness[v] * depth * way / gap
            gradient[v, d] -= force
            gradient[i, d] += weights[0] * force
            gradient[j, d] += weights[1] * force
            gradient[k, d] += weights[2] * force
    return energy


@njit(cache=True, error_model="numpy")
def contact_diagonal(
    x: Floats, triangles: Ints, pairs: Ints, distance: float, stiffness: Floats, diagonal: Ints, blocks: Floats
) -> None:
    """Add the diagonal blocks of the contact's Gauss-Newton tangent to `blocks` (nnz, 3, 3); diagonal (n,)."""
    weights, way = np.empty(3), np.empty(3)
    for m in range(len(pairs)):
        v, t = pairs[m, 0], pairs[m, 1]
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        square = on_triangle(x[v], x[i], x[j], x[k], weights)
        if square >= distance * distance or square == 0:
            continue
        for d in range(3):
            way[d] = (x[v, d] - weights[0] * x[i, d] - weights[1] * x[j, d] - weights[2] * x[k, d]) / np.sqrt(square)
        for d in range(3):
            for h in range(3):
                one = stiffness[v] * way[d] * way[h]
                blocks[diagonal[v], d, h] += one
                blocks[diagonal[i], d, h] += weights[0] * weights[0] * one
                blocks[diagonal[j], d, h] += weights[1] * weights[1] * one
                blocks[diagonal[k], d, h] += weights[2] * weights[2] * one
