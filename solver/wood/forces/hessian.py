"""The stiffness matrix of straight rods and bonds, its pattern fixed as long as no vertex is added."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..model.arrays import Bonds, Rods
from .elements import elements, spread

__all__ = ["Stiffness"]


class Stiffness:
    """K over the free vertices, in blocks; bonds that were handed over need a new one."""

    def __init__(self, rods: Rods, bonds: Bonds, free: np.ndarray) -> None:
        """Fix the pattern for free (v,) bool: vertices that are not held."""
        p, q = rods.before, rods.after
        edge = np.column_stack([rods.a, rods.b, np.full(len(rods.a), -1)])
        hinge = np.column_stack([rods.a[p], rods.b[p], rods.b[q]])
        bond = np.column_stack([bonds.i, rods.a[bonds.j], rods.b[bonds.j]])
        self.size = int(free.sum())
        # the last entry stands for the missing third vertex of an edge
        number = np.full(len(free) + 1, -1, np.int64)
        number[:-1][free] = np.arange(self.size)
        of = number[np.concatenate([edge, hinge, bond])]
        rows = np.broadcast_to(of[:, :, None], (len(of), 3, 3))
        columns = np.broadcast_to(of[:, None, :], (len(of), 3, 3))
        inside = (rows >= 0) & (columns >= 0)
        alone = np.arange(self.size, dtype=np.int64) * (self.size + 1)
        codes = np.concatenate([rows[inside] * self.size + columns[inside], alone])
        unique, at = np.unique(codes, return_inverse=True)
        own = int(inside.sum())
        self.place = np.full(inside.shape, -1, np.int64)
        self.place[inside] = at[:own]
        self.diagonal = at[own : own + self.size]
        self.indices = unique % max(self.size, 1)
        self.indptr = np.searchsorted(unique, np.arange(self.size + 1, dtype=np.int64) * self.size)

    def blocks(self, x: np.ndarray, rods: Rods, bonds: Bonds, diagonal: float = 0.0) -> np.ndarray:
        """Return the blocks (nnz, 3, 3) of K [N/m] at x (v, 3) with `diagonal` added."""
        out = np.zeros((len(self.indices), 3, 3))
        spread(elements(x, rods, bonds), self.place, out)
        for c in range(3):
            out[self.diagonal, c, c] += diagonal
        return out

    def matrix(self, x: np.ndarray, rods: Rods, bonds: Bonds, diagonal: float = 0.0) -> sp.bsr_matrix:
        """Return K [N/m] with `diagonal` added, over the free degrees of freedom."""
        data = self.blocks(x, rods, bonds, diagonal)
        return sp.bsr_matrix((data, self.indices, self.indptr), shape=(3 * self.size, 3 * self.size))
