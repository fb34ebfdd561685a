"""Multifrontal Cholesky factor L L^T of a semidefinite matrix with one number per pair of vertices.

It is found in pieces of bounded work, so that whoever waits for it can look up in between. Duff and Reid 1983.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numba import njit

from ..arrays import Floats, Ints, Singles
from .dissection import Fronts

__all__ = ["factor"]

#: Multiplications of one piece of a factorisation: some milliseconds.
_PIECE = 5_000_000
#: Columns of a panel: with a front's whole width they stay in the second cache.
_PANEL = 32
#: Rows of a front from which on BLAS takes panels out of it, and their columns then.
_LARGE, _WIDE = 320, 128
#: Pivots below are taken for 1 [mu].
_FLOOR = 1e-8


def factor(fronts: Fronts, indptr: Ints, indices: Ints, data: Floats) -> Generator[None, None, Singles]:
    """Factor the matrix with entries `data` (nnz,) on a pattern (CSR); the generator's value: columns, end to end.

    Raises:
        numpy.linalg.LinAlgError: it is not finite.

    """
    total = fronts.starts[-1]
    values = np.empty(total[1], np.float32)
    kept, room = _room(fronts.starts[:, 2])
    complements = np.empty(room)
    place = np.full(len(indptr) - 1, -1)
    size, own = np.diff(fronts.starts[:, 0]), fronts.own
    # sum over the eliminated columns of what is left, squared
    work = np.cumsum((size**3 - (size - own) ** 3) / 3 + size**2)
    at = 0
    while at < len(own):
        done = work[at - 1] if at else 0.0
        end = max(at + 1, int(np.searchsorted(work, done + _PIECE)))
        good = _eliminate(at, end, fronts, indptr, indices, data, place, complements, kept, values)
        if not good:
            raise np.linalg.LinAlgError("the tangent is not finite")
        at = end
        yield
    return values


def _room(starts: Ints) -> tuple[Ints, int]:
    """Return where the complement of each front is kept, and how much room all take; starts (f + 1,): end to end.

    A complement is asked for by the next level alone, so that a level takes the place of the one before the last.
    """
    count = len(starts) - 1
    # levels halve: the last front is the root
    begin = count - (1 << np.arange(count.bit_length(), 0, -1)) + 1
    level = np.searchsorted(begin, np.arange(count), side="right") - 1
    sizes = np.diff(np.append(starts[begin], starts[-1]))
    even, odd = int(sizes[::2].max(initial=0)), int(sizes[1::2].max(initial=0))
    return starts[:-1] - starts[begin][level] + even * (level % 2), even + odd


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _pivots(w: Floats, first: int, last: int, end: int) -> bool:
    """Eliminate columns first to last - 1 of a front from rows up to end - 1; returns whether pivots are numbers."""
    for c in range(first, last):
        if np.isnan(w[c, c]):
            return False
        # the matrices are semidefinite: what is below is rounding, of slivers mostly
        if w[c, c] < _FLOOR:
            w[c, c:] = 0.0
            w[c, c] = 1.0
        column = w[c, c:]
        column /= np.sqrt(w[c, c])
        for e in range(c + 1, end):
            a, row, tail = w[c, e], w[e, e:], w[c, e:]
            for r in range(len(row)):
                row[r] -= a * tail[r]
    return True


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _take_four(w: Floats, p: int, e: int) -> None:
    """Take columns p to p + 3 of a front out of its row e."""
    row, w0, w1, w2, w3 = w[e, e:], w[p, e:], w[p + 1, e:], w[p + 2, e:], w[p + 3, e:]
    a0, a1, a2, a3 = w0[0], w1[0], w2[0], w3[0]
    for r in range(len(row)):
        row[r] -= a0 * w0[r] + a1 * w1[r] + a2 * w2[r] + a3 * w3[r]


@njit(cache=True, error_model="numpy")
def _take_panel(w: Floats, panel: int, end: int) -> None:
    """Take columns panel to end - 1 of a front out of all its rows from end on, by BLAS."""
    columns = w[panel:end, end:].T.copy()
    for first in range(0, len(columns), _WIDE):
        last = min(first + _WIDE, len(columns))
        product = np.dot(columns[first:last], columns[first:].T)
        for e in range(first, last):
            row, taken = w[end + e, end + e :], product[e - first, e - first :]
            for r in range(len(row)):
                row[r] -= taken[r]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _eliminate(
    first: int, last: int, fronts: Fronts, indptr: Ints, indices: Ints, data: Floats,
    place: Ints, complements: Floats, kept: Ints, values: Singles,
) -> bool:  # fmt: skip
    """Eliminate fronts first to last - 1; returns whether all pivots were finite. place (n,): -1 on entry and exit.

    kept (f,): where the complement of each front begins. Fronts are symmetric; row c of w holds column c from the
    diagonal on.
    """
    nodes, starts, own, children = fronts
    for f in range(first, last):
        begin, pivots = starts[f, 0], own[f]
        size = starts[f + 1, 0] - begin
        if size == 0:
            continue
        w = np.zeros((size, size))
        for r in range(size):
            place[nodes[begin + r]] = r
        for c in range(pivots):
            node = nodes[begin + c]
            for at in range(indptr[node], indptr[node + 1]):
                r = place[indices[at]]
                if r >= c:
                    w[c, r] += data[at]
        for child in children[f]:
            if child < 0:
                continue
            lead = starts[child, 0] + own[child]
            wide = starts[child + 1, 0] - lead
            at = kept[child]
            for c in range(wide):
                column = place[nodes[lead + c]]
                for r in range(c, wide):
                    row = place[nodes[lead + r]]
                    w[min(row, column), max(row, column)] += complements[at + c * wide + r]
        for r in range(size):
            place[nodes[begin + r]] = -1
        # four columns at a time, so that the rest of the front is read and written a fourth as often, and the rest
        # row by row for a panel of them, which stays in the cache: every entry is taken from in the same order
        fours = pivots - pivots % 4
        wide = _WIDE if size >= _LARGE else _PANEL
        for panel in range(0, fours, wide):
            end = min(panel + wide, fours)
            for p in range(panel, end, 4):
                if not _pivots(w, p, p + 4, p + 4):
                    return False
                for e in range(p + 4, end):
                    _take_four(w, p, e)
            if size >= _LARGE:
                _take_panel(w, panel, end)
                continue
            for e in range(end, size):
                for p in range(panel, end, 4):
                    _take_four(w, p, e)
        if not _pivots(w, fours, pivots, size):
            return False
        at = starts[f, 1]
        for c in range(pivots):
            for r in range(c, size):
                values[at] = w[c, r]
                at += 1
        at = kept[f]
        wide = size - pivots
        for c in range(wide):
            for r in range(c, wide):
                complements[at + c * wide + r] = w[pivots + c, pivots + r]
    return True
