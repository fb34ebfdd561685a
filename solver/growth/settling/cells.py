"""Some vertices of a fine mesh as a mesh of their own, and what moves there carried over to the fine one.

The coarser mesh is the dual of the cells about its vertices, which are Voronoi cells along the sheet.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numba import njit

from ... import shell
from ...arrays import Floats, Ints
from ...contract import InvalidGeometry
from ...linalg.patterns import of_pairs

__all__ = ["Coarser", "carried", "coarser"]

#: Rings about each vertex of the coarser mesh in which there is no other: a fourteenth is left of a regular mesh.
_RINGS = 3
#: Least square by which slopes are fitted, over the largest.
_THIN = 1e-3


class Coarser(NamedTuple):
    """Vertices `seeds` (m,) of a finer mesh as a mesh of their own.

    Each vertex of the finer one lies between `corners` (n, 3) of the coarser, by barycentric `weights` (n, 3), in
    triangle `within` (n,) there.
    """

    seeds: Ints
    mesh: shell.Topology
    corners: Ints
    weights: Floats
    within: Ints


def coarser(mesh: shell.Topology, x: Floats) -> Coarser | None:
    """Return a coarser mesh for vertices at x (n, 3); None where its cells make no surface."""
    indptr, indices, _ = of_pairs(mesh.edges, mesh.vertices)
    first = np.unique(mesh.edges[mesh.border])
    rim = np.zeros(mesh.vertices, np.bool_)
    rim[first] = True
    seeds = _spread(indptr, indices, np.concatenate([first, np.flatnonzero(~rim)]), _RINGS)
    cell = _cells(indptr, indices, x, seeds)
    between = cell[mesh.triangles]
    between = between[(between != np.roll(between, 1, axis=1)).all(axis=1)]
    if not len(between):
        return None
    # a triple of cells may meet more than once
    first_of = np.unique(np.sort(between, axis=1), axis=0, return_index=True)[1]
    try:
        found = shell.topology(between[np.sort(first_of)], len(seeds))
    except InvalidGeometry:
        return None
    about = np.bincount(found.triangles.ravel(), minlength=len(seeds))
    if not about.all():
        return None
    order = np.argsort(found.triangles.ravel(), kind="stable") // 3
    starts = np.concatenate([[0], np.cumsum(about)])
    within, weights = _located(x, cell, x[seeds], found.triangles, starts, order)
    return Coarser(seeds, found, found.triangles[within], weights, within)


def carried(found: Coarser, x: Floats, y: Floats, moved: Floats) -> Floats:
    """Return how far fine vertices at x (n, 3) go where coarse ones at y (m, 3) have `moved` (m, 3).

    Between three corners, half of what lies between their moves goes by their slopes: so even what bends is carried
    over exactly (quadratic precision), and does not kink at coarse edges.
    """
    slopes = _slopes(y, found.mesh.edges, moved)
    there = np.zeros_like(x)
    for k in range(3):
        corner, weight = found.corners[:, k], found.weights[:, k : k + 1]
        turned = (slopes[corner] @ (x - y[corner])[:, :, None])[..., 0]
        there += weight * (moved[corner] + 0.5 * turned)
    return there


def _slopes(y: Floats, edges: Ints, moved: Floats) -> Floats:
    """Return the slopes (m, 3, 3) of moves (m, 3) at y (m, 3) that fit those of the vertices at the other ends best."""
    i, j = edges.T
    ways, changes = y[j] - y[i], moved[j] - moved[i]
    both, square = np.zeros((len(y), 3, 3)), np.zeros((len(y), 3, 3))
    for end in (i, j):
        # either end sees both the other way round, which leaves their product
        np.add.at(both, end, changes[:, :, None] * ways[:, None, :])
        np.add.at(square, end, ways[:, :, None] * ways[:, None, :])
    sizes, axes = np.linalg.eigh(square)
    # across the surface there is nothing to tell slopes from
    inverse = np.where(np.arange(3) > 0, 1 / np.maximum(sizes, _THIN * sizes[:, 2:]), 0.0)
    found: Floats = both @ (axes * inverse[:, None, :]) @ np.swapaxes(axes, 1, 2)
    return found


@njit(cache=True)
def _spread(indptr: Ints, indices: Ints, order: Ints, rings: int) -> Ints:
    """Return vertices, in order, none of which is within so many rings of another."""
    n = len(indptr) - 1
    covered = np.zeros(n, np.bool_)
    seen = np.full(n, -1)
    queue, depth = np.empty(n, np.int64), np.empty(n, np.int64)
    found, count = np.empty(n, np.int64), 0
    for v in order:
        if covered[v]:
            continue
        found[count] = v
        count += 1
        queue[0], depth[0], seen[v] = v, 0, v
        first, last = 0, 1
        while first < last:
            u = queue[first]
            covered[u] = True
            if depth[first] < rings:
                for at in range(indptr[u], indptr[u + 1]):
                    w = indices[at]
                    if seen[w] != v:
                        seen[w] = v
                        queue[last], depth[last] = w, depth[first] + 1
                        last += 1
            first += 1
    return found[:count].copy()


@njit(cache=True)
def _cells(indptr: Ints, indices: Ints, x: Floats, seeds: Ints) -> Ints:
    """Return the number (n,) of the seed that is nearest along edges; -1 where none is (Dijkstra 1959)."""
    n = len(indptr) - 1
    cell, far = np.full(n, -1), np.full(n, np.inf)
    heap = [(0.0, seeds[0])]
    heap.pop()
    for k in range(len(seeds)):
        cell[seeds[k]], far[seeds[k]] = k, 0.0
        heappush(heap, (0.0, seeds[k]))
    while len(heap) > 0:
        away, u = heappop(heap)
        if away > far[u]:
            continue
        for at in range(indptr[u], indptr[u + 1]):
            v = indices[at]
            length = 0.0
            for d in range(3):
                length += (x[u, d] - x[v, d]) ** 2
            there = away + np.sqrt(length)
            if there < far[v]:
                far[v], cell[v] = there, cell[u]
                heappush(heap, (there, v))
    return cell


@njit(cache=True, error_model="numpy")
def _located(x: Floats, cell: Ints, y: Floats, triangles: Ints, starts: Ints, order: Ints) -> tuple[Ints, Floats]:
    """Return the triangle (n,) about its seed in which each vertex lies, or least outside of it, and where (n, 3)."""
    within, weights = np.empty(len(x), np.int64), np.empty((len(x), 3))
    for v in range(len(x)):
        most = -np.inf
        for at in range(starts[cell[v]], starts[cell[v] + 1]):
            t = order[at]
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            aa = ab = bb = pa = pb = 0.0
            for d in range(3):
                a, b, p = y[j, d] - y[i, d], y[k, d] - y[i, d], x[v, d] - y[i, d]
                aa += a * a
                ab += a * b
                bb += b * b
                pa += p * a
                pb += p * b
            determinant = aa * bb - ab * ab
            if not determinant > 1e-6 * aa * bb:
                continue
            second, third = (bb * pa - ab * pb) / determinant, (aa * pb - ab * pa) / determinant
            least = min(1 - second - third, min(second, third))
            if least > most:
                most = least
                within[v] = t
                weights[v, 0], weights[v, 1], weights[v, 2] = 1 - second - third, second, third
        if most == -np.inf:
            within[v] = order[starts[cell[v]]]
            for d in range(3):
                weights[v, d] = 1.0 if triangles[within[v], d] == cell[v] else 0.0
    return within, weights
