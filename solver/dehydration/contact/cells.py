"""A grid of cells over moving boxes: which may overlap, each pair met once.

A skin's triangles are all about one size, which suits a grid: it meets the same pairs as the tree of `geometry.boxes`
(`tests/solver/geometry/test_broad_phases.py`), which stands all sizes, in a third of its time.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from ...arrays import Ints, Ints32, Singles
from .data import AT_ONCE, INLINE, OPTIONS, Long, Single

__all__ = ["first_of", "overlapping", "sort_into_cells", "spread"]

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
def sort_into_cells(
    boxes: Singles, grown: Single, cell: Single, keys: Ints, order: Ints32, starts: Ints32, entered: Ints32
) -> Single:
    """Enter each triangle's box, grown, into every cell it overlaps; equal input gives equal order.

    A counting sort by hashed cell fills `order` (entries,) with triangles and `keys` with their cells; `starts` holds
    the first entry of each bucket. Cells widen until the entries fit, so that a few stretched triangles cost memory
    nowhere. `entered` (nt,) is scratch. Returns the width of the cells.
    """
    buckets = starts.size - 1
    while True:
        entries = count = 0
        for t in range(boxes.shape[0]):
            block = 1
            for i in range(3):
                first, last = _cells(boxes, t, i, grown, cell)
                block *= last - first + 1
            entries += block
            entered[count] = t
            count += block > 0
        if entries <= order.size:
            break
        cell *= np.float32(1.5)
    starts[:] = 0
    for filling in range(2):
        for place in range(count):
            t = entered[place]
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


@njit(parallel=True, **OPTIONS)
def spread(
    boxes: Singles, reach: Single, grown: Single, cell: Single, keys: Ints, order: Ints32, entries: int,
    sides: Singles, marks: Ints32,
) -> None:  # fmt: skip
    """Write what two entries are held against, number by number, so that many can be looked at at once.

    sides (6, entries + AT_ONCE): lower corner of the triangle's box, and the upper one moved by `reach`. marks (3, as
    many): both halves of the cell, and bits i: the cell is the first that its triangle overlaps in direction i.
    """
    for entry in prange(entries):
        t, mark = order[entry], 0
        first = cell_key(
            _cells(boxes, t, 0, grown, cell)[0],
            _cells(boxes, t, 1, grown, cell)[0],
            _cells(boxes, t, 2, grown, cell)[0],
        )
        for i in range(3):
            sides[i, entry], sides[3 + i, entry] = boxes[t, i], boxes[t, 3 + i] + reach
            bits = 0x1FFFFF << (21 * i)
            mark |= int((keys[entry] & bits) == (first & bits)) << i
        marks[0, entry], marks[1, entry] = keys[entry] & 0xFFFFFFFF, keys[entry] >> 32
        marks[2, entry] = mark


@njit(**INLINE)
def overlapping(sides: Singles, marks: Ints32, i: int, j: int, last: int) -> int:
    """Bits k of the entries j + k below `last`, AT_ONCE at most, whose triangles are met by that of entry i: they come
    nearer to it than the reach in every direction, and it is here that the two are met.

    Two boxes share a least corner, in a cell that in each direction is the first of one of the two: there alone the
    pair is met. No branches, and places without a sign, which need no look whether they count from the end: so that
    the compiler makes vectors of it.
    """
    low0, low1, low2 = sides[0, i], sides[1, i], sides[2, i]
    high0, high1, high2 = sides[3, i], sides[4, i], sides[5, i]
    key0, key1, mark = marks[0, i], marks[1, i], marks[2, i]
    bits = np.int32(0)
    for k in range(np.uint64(AT_ONCE)):
        e = np.uint64(j) + np.uint64(k)
        met = (
            (marks[0, e] == key0) & (marks[1, e] == key1) & ((marks[2, e] | mark) == 7)
            & (low0 <= sides[3, e]) & (sides[0, e] <= high0)
            & (low1 <= sides[4, e]) & (sides[1, e] <= high1)
            & (low2 <= sides[5, e]) & (sides[2, e] <= high2)
        )  # fmt: skip
        bits |= np.int32(met) << np.int32(k)
    return int(bits) & ((1 << min(last - j, AT_ONCE)) - 1)


@njit(**INLINE)
def first_of(bits: int) -> int:
    """Number of the lowest bit set, of those of `overlapping`: the exponent of its value."""
    lowest = np.float32(bits & -bits)
    return int(lowest.view(np.int32) >> 23) - 127
