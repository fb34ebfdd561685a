"""Which triangle answers for each node and edge of a skin, so that pairs of triangles meet each pair of features once,
and which of those pairs belong to neighbours.

Representative triangles: Curtis, Tamstorf & Manocha 2008, doi 10.1145/1342250.1342260.
"""

from __future__ import annotations

import numpy as np

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
    pairs = _sharing(triangles)
    image = source != np.arange(len(source))
    found = []
    for t, u in (pairs.T, pairs.T[::-1]):
        for i in range(3):
            a, other = own_nodes[t, i], triangles[u]
            apart = (a >= 0) & _all(other != a[:, None]) & ~(image[a] & _all(image[other]))
            found.append(np.column_stack([t, u, a, other, np.zeros_like(a)])[apart])
    t, u = pairs.T
    for i in range(3):
        for j in range(3):
            mine, theirs = own_edges[t, i], own_edges[u, j]
            apart = (mine[:, 0] >= 0) & (theirs[:, 0] >= 0)
            apart &= _all(mine != theirs) & _all(mine != theirs[:, ::-1])
            apart &= ~(_all(image[mine]) & _all(image[theirs]))
            found.append(np.column_stack([t, u, mine, theirs, np.ones_like(t)])[apart])
    return np.ascontiguousarray(np.concatenate(found), np.int32)


def _sharing(triangles: Ints32) -> Ints32:
    """Return the pairs (np, 2) of triangles (nt, 3) that share a node, the lesser first, each once."""
    corners = triangles.ravel()
    order = np.argsort(corners, kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(corners[order]) > 0])
    counts = np.diff(np.r_[starts, len(corners)])
    found = []
    for many in np.unique(counts):
        around = order[starts[counts == many][:, None] + np.arange(many)] // 3
        first, second = np.triu_indices(many, 1)
        found.append(np.stack([around[:, first], around[:, second]], axis=-1).reshape(-1, 2))
    pairs, count = np.concatenate(found), len(triangles)
    # as one number each: rows are sorted some ten times as slowly
    keys = np.unique(pairs.min(axis=1) * count + pairs.max(axis=1))
    return np.stack(np.divmod(keys, count), axis=-1).astype(np.int32)


def _all(each: Bools) -> Bools:
    """Return where all of the few in each row (n, k) are true; numpy's own way takes several times as long."""
    found = each[:, 0].copy()
    for k in range(1, each.shape[1]):
        found &= each[:, k]
    return found
