"""Sparse LDL^T of stacked meshes: nested dissection of the surface, dense fronts, BLAS-3.

A fruit is thin in one direction of its graph: a few nodes along a column, many columns. Dissecting the columns and
keeping each column whole gives fronts that are small and dense, so that LAPACK does all the work: 4 times faster than
SuperLU, and with the inertia (Sylvester's law). MKL's Pardiso is measured in docs/dehydration.md.
Duff and Reid 1983 (multifrontal), George 1973 (nested dissection).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import blas, lapack

from ..arrays import Floats, Ints
from . import dense
from .abreast import both, two
from .dissection import dissect

__all__ = ["Analysis", "Factor", "analyse", "factorise"]

LEAF = 2
"""Parts in the smallest front."""

#: Multiplications of the mean front from which on halves are shared by two threads: between small ones they wait for
#: each other's Python.
_WORTH = 1e6


class Front(NamedTuple):
    """One part of the dissection: what is eliminated there, what it touches, and the parts inside it."""

    nodes: Ints
    """nodes of the front, those eliminated here first"""
    own: int
    """how many are eliminated here"""
    children: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Analysis:
    """Fronts in an order that eliminates children first, and the pattern (node blocks of 3x3, CSR) they are for."""

    fronts: tuple[Front, ...]
    indptr: Ints
    indices: Ints

    @property
    def size(self) -> int:
        """Unknowns."""
        return 3 * (len(self.indptr) - 1)

    @cached_property
    def work(self) -> float:
        """Multiplications that a factor takes."""
        size, own = 3.0 * np.array([(len(front.nodes), front.own) for front in self.fronts]).T
        return float((size**3 - (size - own) ** 3).sum() / 3)

    def halves(self) -> tuple[range, range]:
        """Return the fronts of two parts that do not touch, the first from the first front on; empty without such."""
        last = len(self.fronts) - 1
        # depth first: what is inside a front comes right before it
        while last >= 0 and len(self.fronts[last].children) == 1:
            last -= 1
        if last < 0 or len(self.fronts[last].children) != 2:
            return range(0), range(0)
        first, second = self.fronts[last].children
        return range(first + 1), range(first + 1, second + 1)


def analyse(
    parts: Ints, centres: Floats, indptr: Ints, indices: Ints, per_column: int = 1, leaf_size: int = LEAF,
    thin: bool = False,
) -> Analysis:  # fmt: skip
    """Dissect what couples the nodes of a matrix until parts hold `leaf_size`.

    parts: (p, c) columns that each couples. centres: (p, 3) where it is. per_column: nodes of a column, those of
    column c being c * per_column onwards. indptr, indices: pattern of the matrix by nodes, both triangles. thin: as in
    `dissect`.
    """
    found = dissect(parts, centres, (len(indptr) - 1) // per_column, leaf_size, thin)
    nodes = (found.nodes[:, None] * per_column + np.arange(per_column)).ravel()
    first, own = (found.starts[:, 0] * per_column).tolist(), (found.own * per_column).tolist()
    halves = found.children.tolist()
    fronts: list[Front] = []

    def visit(f: int) -> int:
        # depth first: few complements wait for their parents at a time
        inside = tuple(front for half in halves[f] if half >= 0 and (front := visit(half)) >= 0)
        if not own[f] and len(inside) < 2:
            # nothing is eliminated here: what comes from within goes further up as it is
            return inside[0] if inside else -1
        fronts.append(Front(nodes[first[f] : first[f + 1]], own[f], inside))
        return len(fronts) - 1

    visit(len(found.own) - 1)
    return Analysis(tuple(fronts), indptr, indices)


@njit(cache=True, nogil=True)
def _gather(
    top: Floats, below: Floats, nodes: Ints, own: int, indptr: Ints, indices: Ints, data: Floats, place: Ints
) -> None:
    """Add the matrix's blocks (row in front, column eliminated here), lower triangle, to top and below."""
    for local in range(own):
        node = nodes[local]
        for entry in range(indptr[node], indptr[node + 1]):
            row = place[indices[entry]]
            if row >= local:
                into, row = (top, row) if row < own else (below, row - own)
                for k in range(3):
                    for i in range(3):
                        into[3 * row + i, 3 * local + k] += data[entry, k, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _extend(top: Floats, below: Floats, rest: Floats, inner: Floats, nodes: Ints, place: Ints, own: int) -> None:
    """Add a child's Schur complement (lower triangle, on `nodes`) to a front that eliminates `own` nodes.

    Column by column, as they lie in memory. Of either kind of nodes, those that the front eliminates and the others,
    the child's come in the front's order; of both together they need not.
    """
    count = np.zeros(2, np.int64)
    places, kinds = np.empty(len(nodes), np.int64), np.empty((2, len(nodes)), np.int64)
    for c in range(len(nodes)):
        later = 1 if place[nodes[c]] >= own else 0
        places[c] = 3 * (place[nodes[c]] - later * own)
        kinds[later, count[later]] = c
        count[later] += 1
    for kind in range(2):
        into = rest if kind else top
        for p in range(count[kind]):
            c = kinds[kind, p]
            for k in range(3):
                found, column = inner[:, 3 * c + k], into[:, places[c] + k]
                for i in range(k, 3):
                    column[places[c] + i] += found[3 * c + i]
                for q in range(p + 1, count[kind]):
                    r = kinds[kind, q]
                    for i in range(3):
                        column[places[r] + i] += found[3 * r + i]
    for p in range(count[0]):
        c = kinds[0, p]
        for k in range(3):
            found, column = inner[:, 3 * c + k], below[:, places[c] + k]
            for q in range(count[1]):
                r = kinds[1, q]
                for i in range(3):
                    column[places[r] + i] += found[3 * r + i] if r > c else inner[3 * c + k, 3 * r + i]


class _Block(NamedTuple):
    """Factor of one front: Cholesky where it exists (signs None), else Bunch-Kaufman."""

    pivot: Floats
    signs: Any
    below: Floats


def _negatives(pivot: Floats, signs: Any) -> int:
    """Negative eigenvalues of Bunch-Kaufman's D: negative 1x1 pivots, and one for each 2x2 pivot (det < 0)."""
    single = signs > 0
    return int(np.sum(np.diagonal(pivot)[single] < 0) + np.sum(~single) // 2)


@dataclass(frozen=True, eq=False)
class Factor:
    """L D L^T of a symmetric matrix. negative: number of negative eigenvalues."""

    analysis: Analysis
    blocks: tuple[_Block, ...]
    negative: int

    def solve(self, right: Floats) -> Floats:
        """Return x of A x = right, both (size,)."""
        x = np.asarray(right, dtype=float).reshape(-1, 3).copy()
        steps = [
            (front.nodes[: front.own], front.nodes[front.own :], block)
            for front, block in zip(self.analysis.fronts, self.blocks, strict=True)
            if front.own
        ]
        for own, rest, (pivot, signs, below) in steps:
            part = x[own].ravel()
            part = _half(pivot, part, 0) if signs is None else lapack.dsytrs(pivot, signs, part, lower=1)[0].ravel()
            x[own] = part.reshape(-1, 3)
            if len(rest):
                x[rest] -= (below @ part).reshape(-1, 3)
        for own, rest, (pivot, signs, below) in reversed(steps):
            part, above = x[own].ravel(), below.T @ x[rest].ravel()
            if signs is None:
                part = _half(pivot, part - above, 1)
            else:
                part = part - lapack.dsytrs(pivot, signs, above, lower=1)[0].ravel()
            x[own] = part.reshape(-1, 3)
        return x.ravel()


def _half(pivot: Floats, right: Floats, transposed: int) -> Floats:
    """One triangular solve."""
    return blas.dtrsv(pivot, right, lower=1, trans=transposed)


def _eliminate(top: Floats, below: Floats, rest: Floats) -> tuple[_Block, int]:
    """Eliminate the pivots of a front; `rest` becomes the Schur complement (lower triangle)."""
    factor = top.copy(order="F")
    if not dense.cholesky(factor):
        if len(below):
            dense.right_solve(factor, below)
            dense.take_square(below, rest)
        return _Block(factor, None, below), 0
    factor, signs, failed = lapack.dsytrf(top, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is singular to working precision")
    if len(below):
        rest -= below @ lapack.dsytrs(factor, signs, below.T, lower=1)[0]
    return _Block(factor, signs, below), _negatives(factor, signs)


class _Elimination:
    """A factorisation under way: what fronts have left so far, by number."""

    def __init__(self, analysis: Analysis, data: Floats, definite: bool) -> None:
        self._analysis, self._data, self._definite = analysis, data, definite
        self.blocks: dict[int, _Block] = {}
        self.negative: dict[int, int] = {}
        self._open: dict[int, Floats] = {}

    def take(self, numbers: range, watch: Callable[[], None]) -> None:
        """Eliminate fronts, whose children have been or are among them; watch: called before each.

        Raises:
            numpy.linalg.LinAlgError: a front is exactly singular or, where it must be, not positive definite.

        """
        analysis = self._analysis
        place = np.full(len(analysis.indptr) - 1, -1)
        for number in numbers:
            watch()
            front = analysis.fronts[number]
            size, pivots = 3 * len(front.nodes), 3 * front.own
            place[front.nodes] = np.arange(len(front.nodes))
            top, below = np.zeros((pivots, pivots), order="F"), np.zeros((size - pivots, pivots), order="F")
            rest = np.zeros((size - pivots, size - pivots), order="F")
            _gather(top, below, front.nodes, front.own, analysis.indptr, analysis.indices, self._data, place)
            for child in front.children:
                inner = analysis.fronts[child]
                _extend(top, below, rest, self._open.pop(child), inner.nodes[inner.own :], place, front.own)
            place[front.nodes] = -1
            block, below_zero = _eliminate(top, below, rest) if pivots else (_Block(top, None, below), 0)
            if self._definite and block.signs is not None:
                raise np.linalg.LinAlgError("the matrix is not positive definite")
            self.blocks[number], self.negative[number], self._open[number] = block, below_zero, rest


def factorise(
    analysis: Analysis, data: Floats, watch: Callable[[], None] | None = None, definite: bool = False
) -> Factor:
    """Return the factor of the symmetric matrix with blocks `data` (nnz, 3, 3) on the analysed pattern.

    watch: called before fronts; what it raises ends the factorisation. definite: end it where it is not.

    Raises numpy.linalg.LinAlgError if a front is exactly singular; with `definite`, if one is not positive definite.
    """
    watch, count = watch or _nothing, len(analysis.fronts)
    work = _Elimination(analysis, data, definite)
    shared = two() and analysis.work >= _WORTH * count
    first, second = analysis.halves() if shared else (range(0), range(0))
    if second:
        both(lambda: work.take(first, watch), lambda ended: work.take(second, lambda: _leave(ended)))
    work.take(range(second.stop, count), watch)
    return Factor(analysis, tuple(work.blocks[f] for f in range(count)), sum(work.negative.values()))


def _nothing() -> None:
    pass


def _leave(ended: threading.Event) -> None:
    """Leave off where the other half has failed."""
    if ended.is_set():
        raise InterruptedError
