"""Which of many boxes overlap: a tree over the boxes in Morton order.

A space-filling curve puts boxes that are near each other into one leaf, and the tree needs no pointers: leaf i holds
the next LEAF boxes of the order, node k of the heap above the leaves has children 2 k + 1 and 2 k + 2. Unlike a grid
it stands sizes that differ by orders of magnitude. Lauterbach et al. 2009, doi 10.1111/j.1467-8659.2009.01377.x.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["LEAF", "Boxes", "leaf_pairs", "sort_boxes", "touching"]

Doubles = NDArray[np.float64]
Longs = NDArray[np.int64]

LEAF = 8
"""Boxes per leaf: 8 find the pairs of 100,000 triangles in two thirds of the time that 4 take."""
_BITS = 20


class Boxes(NamedTuple):
    """Boxes, sorted into a tree; a named tuple because numba reads those natively."""

    order: Longs
    """(nb,) box at each place of the curve; leaf i holds the places LEAF i to LEAF (i + 1)"""
    leaves: int
    """number of leaves, a power of two (the last ones may be empty)"""
    low: Doubles
    """(2 leaves - 1, 3) of what is below each node of the heap; leaf i is node leaves - 1 + i; infinite where empty"""
    high: Doubles


def sort_boxes(low: Doubles, high: Doubles) -> Boxes:
    """Return the tree of boxes with corners `low` and `high`, both (nb, 3) and finite."""
    order = _order((low + high) / 2)
    count = -(-len(order) // LEAF)
    leaves = 1 << max(count - 1, 0).bit_length()
    tree = Boxes(order, leaves, np.full((2 * leaves - 1, 3), np.inf), np.full((2 * leaves - 1, 3), -np.inf))
    _enclose(low, high, *tree)
    return tree


def _order(centres: Doubles) -> Longs:
    """Order of points (n, 3) along the Morton curve."""
    if not len(centres):
        return np.empty(0, np.int64)
    first = centres.min(axis=0)
    extent = float((centres.max(axis=0) - first).max()) or 1.0
    cells = ((centres - first) * ((2**_BITS - 1) / extent)).astype(np.int64)
    key = np.zeros(len(centres), np.int64)
    for axis in range(3):
        spread = cells[:, axis]
        # each step halves the runs of bits and puts them twice as far apart
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            spread = (spread | (spread << shift)) & mask
        key |= spread << axis
    return np.argsort(key, kind="stable")


@njit(cache=True, error_model="numpy")
def _enclose(low: Doubles, high: Doubles, order: Longs, leaves: int, node_low: Doubles, node_high: Doubles) -> None:
    """Fill the boxes of the heap's nodes, leaves first."""
    for place in range(order.size):
        node = leaves - 1 + place // LEAF
        for k in range(3):
            node_low[node, k] = min(node_low[node, k], low[order[place], k])
            node_high[node, k] = max(node_high[node, k], high[order[place], k])
    for node in range(2 * leaves - 2, 0, -1):
        parent = (node - 1) // 2
        for k in range(3):
            node_low[parent, k] = min(node_low[parent, k], node_low[node, k])
            node_high[parent, k] = max(node_high[parent, k], node_high[node, k])


@njit(cache=True, error_model="numpy")
def _apart(low: Doubles, high: Doubles, a: int, b: int) -> bool:
    separate: bool = (
        low[a, 0] > high[b, 0] or low[b, 0] > high[a, 0]
        or low[a, 1] > high[b, 1] or low[b, 1] > high[a, 1]
        or low[a, 2] > high[b, 2] or low[b, 2] > high[a, 2]
    )  # fmt: skip
    return separate


@njit(cache=True, error_model="numpy")
def leaf_pairs(tree: Boxes) -> Longs:
    """Return the pairs of leaves (np, 2) whose boxes touch, each once, first <= second; a leaf is its own partner."""
    low, high, leaves = tree.low, tree.high, tree.leaves
    found, room = np.empty((max(16 * leaves, 16), 2), np.int64), 0
    # a pair of nodes puts at most four on the stack and the heap is at most 48 deep
    stack, depth = np.empty((4 * 64, 2), np.int64), 1
    stack[0] = 0
    while depth:
        depth -= 1
        a, b = stack[depth]
        if _apart(low, high, a, b):
            continue
        if a >= leaves - 1 and b >= leaves - 1:
            if room == len(found):
                found = np.concatenate((found, np.empty_like(found)))
            found[room, 0], found[room, 1] = a - leaves + 1, b - leaves + 1
            room += 1
        elif a == b:
            for i, j in ((2 * a + 1, 2 * a + 1), (2 * a + 2, 2 * a + 2), (2 * a + 1, 2 * a + 2)):
                stack[depth, 0], stack[depth, 1] = i, j
                depth += 1
        else:  # all nodes of a level are as far from the leaves
            for i in (2 * a + 1, 2 * a + 2):
                for j in (2 * b + 1, 2 * b + 2):
                    stack[depth, 0], stack[depth, 1] = i, j
                    depth += 1
    return found[:room]


def touching(low: Doubles, high: Doubles) -> Longs:
    """Return the pairs (np, 2) of boxes with corners `low` and `high`, both (nb, 3), that touch, each once."""
    tree = sort_boxes(low, high)
    places = _touching(low[tree.order], high[tree.order], leaf_pairs(tree), LEAF)
    return tree.order[places]


@njit(cache=True, error_model="numpy")
def _touching(low: Doubles, high: Doubles, leaves: Longs, leaf: int) -> Longs:
    """Pairs of places whose boxes touch, among those of all pairs of leaves.

    Every pair is written down, and stays where it touches: no processor guesses which of six sides keeps two boxes
    apart, and a branch for each took eight times as long.
    """
    found, count = np.empty((max(4 * len(low), 2 * leaf), 2), np.int64), 0
    for pair in range(len(leaves)):
        first, second = leaves[pair, 0] * leaf, leaves[pair, 1] * leaf
        for a in range(first, min(first + leaf, len(low))):
            if count + leaf > len(found):
                found = np.concatenate((found, np.empty_like(found)))
            low0, low1, low2 = low[a, 0], low[a, 1], low[a, 2]
            high0, high1, high2 = high[a, 0], high[a, 1], high[a, 2]
            for b in range(a + 1 if first == second else second, min(second + leaf, len(low))):
                found[count, 0], found[count, 1] = a, b
                count += 1 - (
                    (low0 > high[b, 0]) | (low[b, 0] > high0)
                    | (low1 > high[b, 1]) | (low[b, 1] > high1)
                    | (low2 > high[b, 2]) | (low[b, 2] > high2)
                )  # fmt: skip
    return found[:count]
