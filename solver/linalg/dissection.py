"""Order of elimination by nested dissection of places (George 1973), for every multifrontal factor here.

What couples unknowns comes in parts: hinges of a mesh, quads over columns of nodes, pairs of a graph. Parts are halved
again and again along the longer side of where they are; an unknown is eliminated where all parts that touch it first
lie in one half. The halves make a binary tree whose nodes are the fronts of a multifrontal factor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..arrays import Floats, Ints
from .patterns import distinct

__all__ = ["Fronts", "dissect"]


class Fronts(NamedTuple):
    """Fronts in the order of elimination, children before parents, level by level.

    nodes: unknowns of all fronts, end to end, those eliminated in each first. starts: (f + 1, 3) offsets into nodes,
    into the columns of a triangular factor and into the complements that go to parents. own: (f,) eliminated in each.
    children: (f, 2), -1 where there are none.
    """

    nodes: Ints
    starts: Ints
    own: Ints
    children: Ints


def dissect(parts: Ints, centres: Floats, vertices: int, leaf_size: int, thin: bool = False) -> Fronts:
    """Return the fronts of the graph whose cliques are `parts` (p, c), which lie at `centres` (p, 3).

    leaf_size: parts in the smallest front: fewer make more fronts, more make them fuller. Every vertex must be in a
    part. thin: cut across the axis that leaves the fewest vertices to both halves instead of the longest one.
    """
    depth = max(0, int(np.ceil(np.log2(max(len(parts), 1) / leaf_size))))
    leaf = np.empty(len(parts), np.int64)
    ranks = np.stack([np.unique(along, return_inverse=True)[1] for along in centres.T])
    _halve(parts, centres, ranks, vertices, depth, thin, leaf)
    leaves = np.repeat(leaf, parts.shape[1])
    low, high = np.full(vertices, 1 << depth), np.full(vertices, -1)
    np.minimum.at(low, parts.ravel(), leaves)
    np.maximum.at(high, parts.ravel(), leaves)
    # the level at which both ends of a vertex's range of leaves have one parent
    level_of = depth - np.ceil(np.log2((low ^ high) + 1)).astype(np.int64)
    keys = distinct(leaves * vertices + parts.ravel())
    nodes, own, sizes, children, before = [], [], [], [], 0
    for level in range(depth, -1, -1):
        count = 1 << level
        front, vertex = np.divmod(keys, vertices)
        done = level_of[vertex] == level
        nodes.append(vertex[np.argsort(2 * front + ~done, kind="stable")])
        own.append(np.bincount(front[done], minlength=count))
        sizes.append(np.bincount(front, minlength=count))
        leads = before - 2 * count + np.arange(2 * count).reshape(-1, 2)
        children.append(np.full((count, 2), -1) if level == depth else leads)
        before += count
        keys = distinct((front[~done] >> 1) * vertices + vertex[~done])
    size, mine = np.concatenate(sizes), np.concatenate(own)
    columns = mine * size - mine * (mine - 1) // 2
    lengths = np.stack([size, columns, (size - mine) ** 2], -1)
    return Fronts(
        nodes=np.concatenate(nodes),
        starts=np.concatenate([np.zeros((1, 3), np.int64), np.cumsum(lengths, axis=0)]),
        own=mine,
        children=np.concatenate(children),
    )


@njit(cache=True)
def _shared(parts: Ints, order: Ints, mark: Ints) -> int:
    """Return how many vertices both halves of `order` touch; mark (vertices,): zeros on entry and exit."""
    half, found = (len(order) + 1) // 2, 0
    for p in order[:half]:
        mark[parts[p]] = 1
    for p in order[half:]:
        for v in parts[p]:
            found += mark[v] == 1
            mark[v] = min(mark[v], 0)
    for p in order[:half]:
        mark[parts[p]] = 0
    return found


@njit(cache=True)
def _sorted(order: Ints, part: Ints, bounds: Ints, ranks: Ints, axes: Ints) -> Ints:
    """Return `order` sorted within each part by rank along the part's axis: stably, by counting, all parts at once."""
    rank, cursor = np.empty_like(order), np.zeros(len(order) + 1, np.int64)
    for p in range(len(order)):
        rank[p] = ranks[axes[part[p]], p]
        cursor[rank[p] + 1] += 1
    cursor = np.cumsum(cursor)
    ranked, found, at = np.empty_like(order), np.empty_like(order), bounds[:-1].copy()
    for p in order:
        ranked[cursor[rank[p]]] = p
        cursor[rank[p]] += 1
    for p in ranked:
        found[at[part[p]]] = p
        at[part[p]] += 1
    return found


@njit(cache=True, nogil=True)
def _halve(parts: Ints, centres: Floats, ranks: Ints, vertices: int, depth: int, thin: bool, leaf: Ints) -> None:
    """Write the leaf of each part; ranks (3, p): of the centres along each axis."""
    count, mark = len(centres), np.zeros(vertices if thin else 0, np.int64)
    order, bounds = np.arange(count), np.array([0, count])
    leaf[:] = 0
    for _ in range(depth):
        halved = len(bounds) - 1
        axes, least = np.zeros(halved, np.int64), np.full(halved, np.inf)
        for axis in range(3):
            way = _sorted(order, leaf, bounds, ranks, np.full(halved, axis)) if thin else order
            for k in range(halved):
                part = way[bounds[k] : bounds[k + 1]]
                cost = float(_shared(parts, part, mark)) if thin else -_extent(centres, part, axis)
                if cost < least[k]:
                    axes[k], least[k] = axis, cost
        order = _sorted(order, leaf, bounds, ranks, axes)
        finer = np.empty(2 * halved + 1, np.int64)
        for k in range(halved):
            first, last = bounds[k], bounds[k + 1]
            middle = (first + last + 1) // 2
            leaf[order[first:middle]], leaf[order[middle:last]] = 2 * k, 2 * k + 1
            finer[2 * k], finer[2 * k + 1] = first, middle
        finer[-1] = count
        bounds = finer


@njit(cache=True)
def _extent(centres: Floats, part: Ints, axis: int) -> float:
    small, large = np.inf, -np.inf
    for p in part:
        small, large = min(small, centres[p, axis]), max(large, centres[p, axis])
    return large - small
