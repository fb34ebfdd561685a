"""The tree of all sizes and the contact's grid of one size meet the same pairs."""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact.cells import first_of, overlapping, sort_into_cells, spread
from solver.dehydration.contact.data import AT_ONCE
from solver.geometry.boxes import touching
from solver.geometry.crossings import split_quads

from .._skins import cubed_sphere


@njit(error_model="numpy")
def _met(boxes, reach, cell, keys, order, starts, found):
    entries, count = starts[-1], 0
    sides = np.zeros((6, entries + AT_ONCE), np.float32)
    marks = np.zeros((3, entries + AT_ONCE), np.int32)
    spread(boxes, reach, np.float32(0.5) * reach, cell, keys, order, entries, sides, marks)
    for bucket in range(starts.size - 1):
        last = starts[bucket + 1]
        for i in range(starts[bucket], last):
            for j in range(i + 1, last, AT_ONCE):
                bits = overlapping(sides, marks, i, j, last)
                while bits:
                    k = j + first_of(bits)
                    found[count, 0], found[count, 1] = min(order[i], order[k]), max(order[i], order[k])
                    bits &= bits - 1
                    count += 1
    return count


def test_grid_and_tree_meet_the_same_pairs():
    """On a wrinkled skin whose coordinates are multiples of 1/1024, so that both precisions hold every sum exactly."""
    points, quads = cubed_sphere(8)
    waves = 1 + 0.15 * np.sin(9 * points[:, 0] + 1) * np.sin(8 * points[:, 1])
    corners = (np.round(1024 * points * waves[:, None]) / 1024)[split_quads(quads)]
    low, high = corners.min(axis=1), corners.max(axis=1)
    boxes, reach = np.concatenate([low, high], axis=1).astype(np.float32), np.float32(0.125)
    entries, found = 64 * len(boxes), np.zeros((200 * len(boxes), 2), np.int64)
    keys, order, starts = np.zeros(entries, np.int64), np.zeros(entries, np.int32), np.zeros(4097, np.int32)
    cell = sort_into_cells(boxes, reach / 2, np.float32(0.25), keys, order, starts, np.empty(len(boxes), np.int32))
    grid = found[: _met(boxes, reach, cell, keys, order, starts, found)]
    tree = np.sort(touching(low - 0.0625, high + 0.0625), axis=1)
    assert len(grid) > 5 * len(boxes)
    assert set(map(tuple, grid.tolist())) == set(map(tuple, tree.tolist()))
    assert len(grid) == len(tree)
