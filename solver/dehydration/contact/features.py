"""Which triangle answers for each node and edge of a skin, so that pairs of triangles meet each pair of features once.

Representative triangles: Curtis, Tamstorf & Manocha 2008, doi 10.1145/1342250.1342260.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Ints32

__all__ = ["features"]


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
