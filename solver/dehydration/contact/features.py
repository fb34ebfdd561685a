"""Which triangle answers for each node and edge of a skin, so that pairs of triangles meet each pair of features once,
and which of those pairs belong to neighbours.

Representative triangles: Curtis, Tamstorf & Manocha 2008, doi 10.1145/1342250.1342260.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Bools, Ints32

__all__ = ["features", "neighbours"]


def features(triangles: Ints32, nodes: int) -> tuple[Ints32, Ints32]:
    """Return the nodes (nt, 3) and edges (nt, 3, 2) that each of triangles (nt, 3) answers for, then -1.

    The first triangle that has a node or an edge answers for it.
    """
    flat = triangles.ravel()
    _, first = np.unique(flat, return_index=True)
    own = np.full(len(flat), -1, np.int32)
    own[first] = flat[first]
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    key = ends.min(axis=1).astype(np.int64) * nodes + ends.max(axis=1)
    _, first = np.unique(key, return_index=True)
    edges = np.full(ends.shape, -1, np.int32)
    edges[first] = ends[first]
    nodes_of, edges_of = own.reshape(-1, 3), edges.reshape(-1, 3, 2)
    first_nodes, first_edges = (np.argsort(a < 0, axis=1, kind="stable") for a in (nodes_of, edges_of[..., 0]))
    return (
        np.take_along_axis(nodes_of, first_nodes, axis=1),
        np.ascontiguousarray(np.take_along_axis(edges_of, first_edges[..., None], axis=1)),
    )


def neighbours(triangles: Ints32, own_nodes: Ints32, own_edges: Ints32, source: Ints32) -> Ints32:
    """Return what triangles that share a node, but not two of their features, may do to each other: (na, 7).

    Two triangles, then the features: a node and the corners of the other triangle (kind 0), or the ends of two edges
    (kind 1). source (ns,): nodes that others are images of; images alone do nothing.
    """
    image = source != np.arange(len(source))
    pairs = _sharing(np.ascontiguousarray(triangles), len(source))
    given = pairs, triangles, own_nodes, own_edges, image
    found = np.empty((_between(*given, np.empty((0, 7), np.int32)), 7), np.int32)
    _between(*given, found)
    return found


@njit(cache=True)
def _sharing(triangles: Ints32, nodes: int) -> Ints32:
    """Return the pairs (np, 2) of triangles (nt, 3) on so many nodes that share one, the lesser first, in order."""
    first = np.zeros(nodes + 1, np.int64)
    for v in triangles.ravel():
        first[v + 1] += 1
    first = np.cumsum(first)
    around, fill = np.empty(first[-1], np.int32), first[:-1].copy()
    for t in range(len(triangles)):
        for v in triangles[t]:
            around[fill[v]] = t
            fill[v] += 1
    pairs, count = np.empty((8 * len(triangles) + 64, 2), np.int32), 0
    for t in range(len(triangles)):
        start = count
        for i in range(3):
            for u in around[first[triangles[t, i]] : first[triangles[t, i] + 1]]:
                if u <= t or _has(triangles[u], triangles[t, :i]):
                    continue  # met already
                if count == len(pairs):
                    pairs = np.concatenate((pairs, np.empty_like(pairs)))
                place = count
                while place > start and pairs[place - 1, 1] > u:
                    pairs[place] = pairs[place - 1]
                    place -= 1
                pairs[place, 0], pairs[place, 1] = t, u
                count += 1
    return pairs[:count].copy()


@njit(cache=True)
def _between(
    pairs: Ints32, triangles: Ints32, own_nodes: Ints32, own_edges: Ints32, image: Bools, found: Ints32
) -> int:
    """Fill what pairs of triangles may do to each other (see `neighbours`); return how much, and only that if `found`
    is empty.
    """
    count, is_asked = 0, len(found) > 0
    for turned in range(2):
        for i in range(3):
            for n in range(len(pairs)):
                t, u = pairs[n, turned], pairs[n, 1 - turned]
                a, other = own_nodes[t, i], triangles[u]
                if a < 0 or _has(other, own_nodes[t, i : i + 1]):
                    continue
                if image[a] and image[other[0]] and image[other[1]] and image[other[2]]:
                    continue
                if is_asked:
                    found[count, 0], found[count, 1], found[count, 2], found[count, 6] = t, u, a, 0
                    found[count, 3:6] = other
                count += 1
    for i in range(3):
        for j in range(3):
            for n in range(len(pairs)):
                t, u = pairs[n, 0], pairs[n, 1]
                (a, b), (c, d) = own_edges[t, i], own_edges[u, j]
                if a < 0 or c < 0 or a in (c, d) or b in (c, d):
                    continue
                if image[a] and image[b] and image[c] and image[d]:
                    continue
                if is_asked:
                    found[count, 0], found[count, 1], found[count, 6] = t, u, 1
                    found[count, 2], found[count, 3], found[count, 4], found[count, 5] = a, b, c, d
                count += 1
    return count


@njit(cache=True)
def _has(some: Ints32, any_of: Ints32) -> bool:
    for a in some:
        for b in any_of:
            if a == b:
                return True
    return False
