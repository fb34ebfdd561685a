"""A grid of cells over moving boxes: which may overlap, each pair met once.

A skin's triangles are all about one size, which suits a grid: it meets the same pairs as the tree of `geometry.boxes`
(`tests/solver/geometry/test_broad_phases.py`), which stands all sizes, in a third of its time.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Ints, Ints32, Singles
from .data import INLINE, OPTIONS, Long, Single

__all__ = ["overlapping", "sort_into_cells", "spread"]

WORLD = np.float32(2**20)
"""Cells counted from the origin in each direction; what lies farther out (or is not finite) touches nothing."""


@njit(**INLINE)
def cell_key(i: int, j: int, k: int) -> int:
    """One integer per cell, 21 bits a direction."""
    return ((i & 0x1FFFFF) << 42) | ((j & 0x1FFFFF) << 21) | (k & 0x1FFFFF)


@njit(**INLINE)
def bucket_of(key: int, buckets: int) -> Long:
    """Multiplicative hash of a cell; buckets is a power of two."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(buckets - 1))


@njit(**INLINE)
def _cells(boxes: Singles, t: int, i: int, grown: Single, cell: Single) -> tuple[Long, Long]:
    """First and last cell in direction i that triangle t's box, grown, overlaps; (0, -1) if far away or empty."""
    low, high = boxes[t, i] - grown, boxes[t, 3 + i] + grown
    if not (-WORLD * cell < low <= high < WORLD * cell):
        return np.int64(0), np.int64(-1)
    return np.int64(np.floor(low / cell)), np.int64(np.floor(high / cell))


@njit(**OPTIONS)
def sort_into_cells(boxes: Singles, grown: Single, cell: Single, keys: Ints, order: Ints32, starts: Ints32) -> Single:
    """Enter each triangle's box, grown, into every cell it overlaps; equal input gives equal order.

    A counting sort by hashed cell fills `order` (entries,) with triangles and `keys` with their cells; `starts` holds
    the first entry of each bucket. Cells widen until the entries fit, so that a few stretched triangles cost memory
    nowhere. Returns the width of the cells.
    """
    buckets = starts.size - 1
    while True:
        entries = 0
        for t in range(boxes.shape[0]):
            block = 1
            for i in range(3):
                first, last = _cells(boxes, t, i, grown, cell)
                block *= last - first + 1
            entries += block
        if entries <= order.size:
            break
        cell *= np.float32(1.5)
    starts[:] = 0
    for filling in range(2):
        for t in range(boxes.shape[0]):
            i0, i1 = _cells(boxes, t, 0, grown, cell)
            j0, j1 = _cells(boxes, t, 1, grown, cell)
            k0, k1 = _cells(boxes, t, 2, grown, cell)
            for i in range(i0, i1 + 1):
                for j in range(j0, j1 + 1):
                    for k in range(k0, k1 + 1):
                        key = cell_key(i, j, k)
                        bucket = bucket_of(key, buckets)
                        if filling:
                            order[starts[bucket + 1]] = t
                            keys[starts[bucket + 1]] = key
                        starts[bucket + 1] += 1
        if filling:
            break
        for bucket in range(buckets):
            starts[bucket + 1] += starts[bucket]
        # starts[b + 1] serves as bucket b's cursor: it begins at its first entry and ends at the next bucket's
        for bucket in range(buckets, 0, -1):
            starts[bucket] = starts[bucket - 1]
        starts[0] = 0
    return cell


@njit(**OPTIONS)
def spread(
    boxes: Singles, reach: Single, grown: Single, cell: Single, keys: Ints, order: Ints32, entries: int,
    low: Singles, high: Singles, marks: Ints32,
) -> None:  # fmt: skip
    """Write what two entries are held against side by side: boxes, the upper corner moved by `reach`, and marks.

    Bit i of a mark: the entry's cell is the first that its triangle overlaps in direction i.
    """
    for entry in range(entries):
        t, mark = order[entry], 0
        first = cell_key(
            _cells(boxes, t, 0, grown, cell)[0],
            _cells(boxes, t, 1, grown, cell)[0],
            _cells(boxes, t, 2, grown, cell)[0],
        )
        for i in range(3):
            low[entry, i], high[entry, i] = boxes[t, i], boxes[t, 3 + i] + reach
            bits = 0x1FFFFF << (21 * i)
            mark |= int((keys[entry] & bits) == (first & bits)) << i
        marks[entry] = mark


@njit(**INLINE)
def overlapping(keys: Ints, low: Singles, high: Singles, marks: Ints32, i: int, j: int) -> bool:
    """Whether the triangles of entries i and j come nearer than the reach in every direction, and are met here.

    Two boxes share a least corner, in a cell that in each direction is the first of one of the two: there alone the
    pair is met. No branches: most pairs fail somewhere, nobody knows where.
    """
    return bool(
        (keys[i] == keys[j]) & ((marks[i] | marks[j]) == 7)
        & (low[i, 0] <= high[j, 0]) & (low[j, 0] <= high[i, 0])
        & (low[i, 1] <= high[j, 1]) & (low[j, 1] <= high[i, 1])
        & (low[i, 2] <= high[j, 2]) & (low[j, 2] <= high[i, 2])
    )  # fmt: skip
