"""Forward and back substitution with the factors of both matrices at once: three right sides within, one across."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints, Singles
from .abreast import both, two
from .dissection import Fronts

__all__ = ["substitute"]

#: Unknowns of a matrix from which on a second thread gains more than its start takes.
_MANY = 20_000


def substitute(right: Floats, n: Floats, fronts: Fronts, across: Singles, within: Singles, found: Floats) -> None:
    """Solve both systems for `right` (v, 3) into `found`; n (v, 3): normals."""
    x = np.empty((len(right), 4), np.float32)
    # the factors are single: what is solved is scaled, so that no size of gradient leaves their range
    largest = _scaled(right, n, x)
    if largest == 0.0:
        found[:] = 0.0
        return
    shared = len(right) >= _MANY and len(fronts.own) > 1 and two()
    if shared:
        _halves(fronts, across, within, x)
    else:
        whole = np.array([[0, len(fronts.own)]])
        none = np.empty(0, np.bool_)
        _forward(whole, fronts, across, within, x, none, x)
        _back(whole, fronts, across, within, x)
    _joined(x, n, largest, found)


def _halves(fronts: Fronts, across: Singles, within: Singles, x: Singles) -> None:
    """Substitute in x (v, 4), both halves below the last front on a thread each.

    Only what the last front eliminates is touched from both. What they take from there is kept, and taken in the order
    in which one thread does: the same to the last bit.
    """
    last = len(fronts.own) - 1
    # levels halve, the longest first
    counts = [1 << level for level in range(last.bit_length() - 1, 0, -1)]
    begin = np.cumsum([0, *counts])[:-1]
    half = np.array(counts) // 2
    left, right = np.stack([begin, begin + half], -1), np.stack([begin + half, begin + 2 * half], -1)
    top = np.array([[last, last + 1]])
    ends = np.zeros(len(x), np.bool_)
    ends[fronts.nodes[fronts.starts[last, 0] :]] = True
    late = np.empty((len(fronts.nodes), 4), np.float32)
    both(
        lambda: _forward(left, fronts, across, within, x, ends, late),
        lambda _: _forward(right, fronts, across, within, x, ends, late),
    )
    _take_late(fronts, ends, late, x)
    _forward(top, fronts, across, within, x, ends, late)
    _back(top, fronts, across, within, x)
    both(
        lambda: _back(left, fronts, across, within, x),
        lambda _: _back(right, fronts, across, within, x),
    )


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _scaled(right: Floats, n: Floats, x: Singles) -> float:
    """Write `right` over its largest number to x (v, 4): within the surface, and across; returns that number."""
    largest = 0.0
    for v in range(len(right)):
        for d in range(3):
            largest = max(largest, abs(right[v, d]))
    if largest == 0.0:
        return largest
    for v in range(len(right)):
        a = right[v, 0] * n[v, 0] + right[v, 1] * n[v, 1] + right[v, 2] * n[v, 2]
        for d in range(3):
            x[v, d] = (right[v, d] - a * n[v, d]) / largest
        x[v, 3] = a / largest
    return largest


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _joined(x: Singles, n: Floats, largest: float, found: Floats) -> None:
    for v in range(len(x)):
        a = x[v, 0] * n[v, 0] + x[v, 1] * n[v, 1] + x[v, 2] * n[v, 2]
        for d in range(3):
            found[v, d] = largest * (x[v, d] + (x[v, 3] - a) * n[v, d])


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _forward(
    levels: Ints, fronts: Fronts, across: Singles, within: Singles, x: Singles, ends: Bools, late: Singles
) -> None:
    """Substitute forward in x (v, 4) by fronts from `levels[:, 0]` to `levels[:, 1]` - 1.

    What is taken from vertices with `ends` (v,) goes to `late` (nodes, 4) instead; an empty `ends`: from none.
    """
    nodes, starts, own = fronts.nodes, fronts.starts, fronts.own
    widest = int((starts[1:, 0] - starts[:-1, 0]).max())
    p0, p1 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    p2, p3 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    for level in range(len(levels)):
        for f in range(levels[level, 0], levels[level, 1]):
            begin, pivots, at = starts[f, 0], own[f], starts[f, 1]
            size = starts[f + 1, 0] - begin
            for r in range(size):
                v = nodes[begin + r]
                if r < pivots:
                    p0[r], p1[r], p2[r], p3[r] = x[v, 0], x[v, 1], x[v, 2], x[v, 3]
                else:
                    p0[r] = p1[r] = p2[r] = p3[r] = np.float32(0)
            for c in range(pivots):
                one, two = within[at : at + size - c], across[at : at + size - c]
                p0[c] /= one[0]
                p1[c] /= one[0]
                p2[c] /= one[0]
                p3[c] /= two[0]
                a0, a1, a2, a3 = p0[c], p1[c], p2[c], p3[c]
                # apart, for more arrays in one loop are not vectorised
                q0, q1, q2, q3 = p0[c:size], p1[c:size], p2[c:size], p3[c:size]
                for r in range(1, len(one)):
                    q0[r] -= one[r] * a0
                    q1[r] -= one[r] * a1
                    q2[r] -= one[r] * a2
                for r in range(1, len(two)):
                    q3[r] -= two[r] * a3
                at += size - c
            for r in range(size):
                v = nodes[begin + r]
                if r < pivots:
                    x[v, 0], x[v, 1], x[v, 2], x[v, 3] = p0[r], p1[r], p2[r], p3[r]
                elif len(ends) and ends[v]:
                    k = begin + r
                    late[k, 0], late[k, 1], late[k, 2], late[k, 3] = p0[r], p1[r], p2[r], p3[r]
                else:
                    x[v, 0] += p0[r]
                    x[v, 1] += p1[r]
                    x[v, 2] += p2[r]
                    x[v, 3] += p3[r]


@njit(cache=True)
def _take_late(fronts: Fronts, ends: Bools, late: Singles, x: Singles) -> None:
    """Take what was kept for vertices with `ends` from x (v, 4), front by front; the last front keeps nothing."""
    nodes, starts, own = fronts.nodes, fronts.starts, fronts.own
    for f in range(len(own) - 1):
        for k in range(starts[f, 0] + own[f], starts[f + 1, 0]):
            v = nodes[k]
            if ends[v]:
                for d in range(4):
                    x[v, d] += late[k, d]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _back(levels: Ints, fronts: Fronts, across: Singles, within: Singles, x: Singles) -> None:
    """Substitute back in x (v, 4) by fronts from `levels[:, 1]` - 1 to `levels[:, 0]`, the last level first."""
    nodes, starts, own = fronts.nodes, fronts.starts, fronts.own
    widest = int((starts[1:, 0] - starts[:-1, 0]).max())
    p0, p1 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    p2, p3 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    for level in range(len(levels) - 1, -1, -1):
        for f in range(levels[level, 1] - 1, levels[level, 0] - 1, -1):
            begin, pivots, at = starts[f, 0], own[f], starts[f + 1, 1]
            size = starts[f + 1, 0] - begin
            for r in range(size):
                v = nodes[begin + r]
                p0[r], p1[r], p2[r], p3[r] = x[v, 0], x[v, 1], x[v, 2], x[v, 3]
            for c in range(pivots - 1, -1, -1):
                at -= size - c
                one, two = within[at : at + size - c], across[at : at + size - c]
                a0, a1, a2, a3 = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                q0, q1, q2, q3 = p0[c:size], p1[c:size], p2[c:size], p3[c:size]
                for r in range(1, len(one)):
                    a0 += one[r] * q0[r]
                    a1 += one[r] * q1[r]
                    a2 += one[r] * q2[r]
                    a3 += two[r] * q3[r]
                p0[c] = (p0[c] - a0) / one[0]
                p1[c] = (p1[c] - a1) / one[0]
                p2[c] = (p2[c] - a2) / one[0]
                p3[c] = (p3[c] - a3) / two[0]
            for r in range(pivots):
                v = nodes[begin + r]
                x[v, 0], x[v, 1], x[v, 2], x[v, 3] = p0[r], p1[r], p2[r], p3[r]
