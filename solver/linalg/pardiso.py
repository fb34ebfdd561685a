"""Factors of positive definite matrices by MKL's Pardiso, which is not ours: the extra `mkl` brings it.

They are those of `multifrontal` up to rounding, and faster where each serves one solve (docs/dehydration.md). A pattern
is analysed once, which costs about as much as a factor.
Schenk and Gärtner 2004.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_matrix, triu

from ..arrays import Floats
from .multifrontal import Analysis

__all__ = ["Factor", "factorise", "load"]

#: Kind of matrix (real, symmetric, positive definite), and phases of Pardiso.
_DEFINITE, _ANALYSE, _FACTOR, _SOLVE = 2, 11, 22, 33
#: Settings of Pardiso by their numbers in MKL's manual: not its defaults; order by METIS; pivots that are perturbed.
_SETTINGS = {1: 1, 2: 2, 10: 13}
#: Its error for a pivot that is not positive.
_NOT_DEFINITE = -4


def load() -> Any:
    """Return a new instance of Pardiso.

    Raises:
        ImportError: it is not installed, or MKL is not.

    """
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver(mtype=_DEFINITE)


class _Pattern:
    """A pattern as Pardiso has analysed it, with the memory of its last factor."""

    def __init__(self, analysis: Analysis) -> None:
        places = np.arange(1.0, 9 * len(analysis.indices) + 1).reshape(-1, 3, 3)
        whole = bsr_array((places, analysis.indices, analysis.indptr), shape=(analysis.size, analysis.size))
        self.matrix = csr_matrix(triu(whole.tocsr(), format="csr"))
        self.matrix.sort_indices()
        self.places = self.matrix.data.astype(np.int64) - 1
        self.factors = 0
        self.peer = load()
        for number, value in _SETTINGS.items():
            self.peer.set_iparm(number, value)
        # its memory is not Python's
        weakref.finalize(self, _free, self.peer).atexit = False

    def run(self, phase: int, right: Floats) -> Floats:
        """Let Pardiso work on the matrix, with one thread: sums depend on how many there are.

        Its own `factorize` would analyse anew each time, and `solve` compare matrices: this is the way around that it
        names.
        """
        from pypardiso.pardiso_wrapper import PyPardisoError

        self.peer.set_phase(phase)
        with _one_thread(self.peer.libmkl):
            try:
                found: Floats = self.peer._call_pardiso(self.matrix, right[:, None])[:, 0]
            except PyPardisoError as error:
                if error.value == _NOT_DEFINITE:
                    raise np.linalg.LinAlgError("the matrix is not positive definite") from error
                raise
        return found


@contextmanager
def _one_thread(library: Any) -> Iterator[None]:
    before = library.MKL_Set_Num_Threads_Local(1)
    try:
        yield
    finally:
        library.MKL_Set_Num_Threads_Local(before)


def _free(peer: Any) -> None:
    peer.free_memory(everything=True)


_PATTERNS: weakref.WeakKeyDictionary[Analysis, _Pattern] = weakref.WeakKeyDictionary()


class Factor:
    """L L^T of a matrix; it lives until the next one on the same analysis."""

    def __init__(self, pattern: _Pattern) -> None:
        self._pattern, self._number = pattern, pattern.factors

    def solve(self, right: Floats) -> Floats:
        """Return x of A x = right, both (size,).

        Raises:
            RuntimeError: the analysis has another factor by now.

        """
        if self._pattern.factors != self._number:
            raise RuntimeError("Pardiso keeps one factor of a pattern, and this was an earlier one")
        return self._pattern.run(_SOLVE, np.asarray(right, dtype=float))


def factorise(analysis: Analysis, data: Floats) -> Factor:
    """Return the factor of the positive definite matrix with blocks `data` (nnz, 3, 3) on the analysed pattern.

    Raises:
        numpy.linalg.LinAlgError: it is not positive definite, or not finite.

    """
    pattern, nothing = _PATTERNS.get(analysis), np.zeros(analysis.size)
    if not np.isfinite(data).all():
        raise np.linalg.LinAlgError("the matrix is not finite")
    new = pattern is None
    pattern = pattern or _PATTERNS.setdefault(analysis, _Pattern(analysis))
    pattern.matrix.data[:] = data.ravel()[pattern.places]
    if new:
        pattern.run(_ANALYSE, nothing)
    pattern.factors += 1
    pattern.run(_FACTOR, nothing)
    return Factor(pattern)
