"""Sparse symmetric matrices of elements along a line, stored by a fixed pattern and factored as bands.

Unknowns run column by column, so that the band is three columns wide and LAPACK's banded routines cost O(n b^2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded, solve_banded

from ..arrays import Bools, Floats, Ints
from .patterns import of_cliques, places

__all__ = ["Factor", "Pattern", "pattern"]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Where the entries of element matrices go.

    unknowns: (ne, n) number of each element unknown, -1 for held ones. size: number of unknowns. rows, columns: of the
    stored entries. places: (ne n n,) stored entry of each element entry, the last one a bin for held ones.
    """

    unknowns: Ints
    size: int
    rows: Ints
    columns: Ints
    places: Ints

    def assemble(self, elements: Floats) -> Floats:
        """Return stored entries (nnz,) of the sum of element matrices (ne, n, n)."""
        return np.bincount(self.places, elements.ravel(), len(self.rows) + 1)[:-1].astype(float, copy=False)

    def vector(self, elements: Floats) -> Floats:
        """Return the sum (size,) of element vectors (ne, n)."""
        place = np.where(self.unknowns < 0, self.size, self.unknowns).ravel()
        return np.bincount(place, elements.ravel(), self.size + 1)[:-1].astype(float, copy=False)

    def matrix(self, entries: Floats) -> sparse.csr_array:
        """Return stored entries as a sparse matrix (size, size)."""
        return sparse.csr_array((entries, (self.rows, self.columns)), shape=(self.size, self.size))

    def hold(self, entries: Floats, held: Bools, diagonal: float) -> Floats:
        """Return entries without the rows and columns of `held` (size,) unknowns, which get `diagonal`."""
        touched = held[self.rows] | held[self.columns]
        return np.where(touched, np.where(self.rows == self.columns, diagonal, 0.0), entries)

    @property
    def bandwidth(self) -> int:
        """Number of subdiagonals."""
        return int((self.rows - self.columns).max())

    def factor(self, entries: Floats) -> Factor | None:
        """Return the Cholesky factor, or None if the matrix is not positive definite."""
        lower = self.rows >= self.columns
        band = np.zeros((self.bandwidth + 1, self.size))
        band[(self.rows - self.columns)[lower], self.columns[lower]] = entries[lower]
        try:
            return Factor(cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False))
        except LinAlgError:
            return None

    def solve(self, entries: Floats, right: Floats) -> Floats:
        """Return the solution (size,) of a system that need not be positive definite."""
        factor = self.factor(entries)
        if factor is not None:
            return factor.solve(right)
        width = self.bandwidth
        band = np.zeros((2 * width + 1, self.size))
        band[width + self.rows - self.columns, self.columns] = entries
        return solve_banded((width, width), band, right, overwrite_ab=True, check_finite=False)


@dataclass(frozen=True, eq=False)
class Factor:
    """A banded Cholesky factor."""

    band: Floats

    def solve(self, right: Floats) -> Floats:
        """Return the solution (size,) for the right-hand side (size,)."""
        return cho_solve_banded((self.band, True), right, check_finite=False)


def pattern(unknowns: Ints, size: int) -> Pattern:
    """Return the pattern of element matrices whose unknowns are numbered `unknowns` (ne, n), -1 for held ones."""
    found = of_cliques(unknowns, size)
    rows = np.repeat(np.arange(size), np.diff(found.indptr))
    place = places(unknowns, found.indptr, found.indices).ravel()
    return Pattern(unknowns, size, rows, found.indices, np.where(place < 0, len(rows), place))
