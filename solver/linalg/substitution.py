"""Forward and back substitution with the factors of both matrices at once: three right sides within, one across."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Singles
from .dissection import Fronts

__all__ = ["substitute"]


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def substitute(right: Floats, n: Floats, fronts: Fronts, across: Singles, within: Singles, found: Floats) -> None:
    """Solve both systems for `right` (v, 3) into `found`; n (v, 3): normals."""
    nodes, starts, own = fronts.nodes, fronts.starts, fronts.own
    count, widest = len(right), int((starts[1:, 0] - starts[:-1, 0]).max())
    x = np.empty((count, 4), np.float32)
    # the factors are single: what is solved is scaled, so that no size of gradient leaves their range
    largest = 0.0
    for v in range(count):
        for d in range(3):
            largest = max(largest, abs(right[v, d]))
    if largest == 0.0:
        found[:] = 0.0
        return
    for v in range(count):
        a = right[v, 0] * n[v, 0] + right[v, 1] * n[v, 1] + right[v, 2] * n[v, 2]
        for d in range(3):
            x[v, d] = (right[v, d] - a * n[v, d]) / largest
        x[v, 3] = a / largest
    p0, p1 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    p2, p3 = np.empty(widest, np.float32), np.empty(widest, np.float32)
    for f in range(len(own)):
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
            else:
                x[v, 0] += p0[r]
                x[v, 1] += p1[r]
                x[v, 2] += p2[r]
                x[v, 3] += p3[r]
    for f in range(len(own) - 1, -1, -1):
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
    for v in range(count):
        a = x[v, 0] * n[v, 0] + x[v, 1] * n[v, 1] + x[v, 2] * n[v, 2]
        for d in range(3):
            found[v, d] = largest * (x[v, d] + (x[v, 3] - a) * n[v, d])
