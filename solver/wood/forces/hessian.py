"""The stiffness matrix of straight rods and bonds, its pattern fixed as long as no vertex is added."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..model.arrays import Bonds, Rods
from ..model.curves import slopes, weights
from .elements import Elements, edges, joints, spread

__all__ = ["Stiffness"]


def _ends(rods: Rods, edge: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return four vertices (b, 4) about each edge, and what they count in place and slope [1/m] at its share.

    What counts are (b, 2, 4), place and slope: as they stand, and along the clamp's direction; then the edge (b,) that
    has this direction, whatever where nothing does.
    """
    beside = np.full((2, len(rods.a)), -1)
    whole = rods.whole == 1
    beside[0, rods.after[whole]] = rods.before[whole]
    beside[1, rods.before[whole]] = rods.after[whole]
    before, behind = (np.where(n[edge] < 0, edge, n[edge]) for n in beside)
    vertex = np.column_stack([rods.a[before], rods.a[edge], rods.b[edge], rods.b[behind]])
    made = slopes(rods)[:, edge]
    # p and q by the edges before, of and behind the bond, and by the edge along the clamp's direction
    zero = np.zeros(len(edge))
    p, q = np.stack([made[0], made[1], zero]), np.stack([zero, made[5], made[4]])
    p, q = p - made[3] * q, q - made[7] * p
    along = np.stack([made[2] - made[3] * made[6], made[6] - made[7] * made[2]])
    place, slope = weights(share)
    parts = np.zeros((2, 3, len(edge)))
    parts[0] = place[0] * p + place[1] * q
    parts[0, 1] += share
    parts[1] = (slope[0] * p + slope[1] * q) / rods.rest[edge]
    parts[1, 1] += 1 / rods.rest[edge]
    weight, reach = np.zeros((len(edge), 2, 4)), np.zeros((len(edge), 2, 4))
    for n in range(3):
        weight[:, :, n] -= parts[:, n].T
        weight[:, :, n + 1] += parts[:, n].T
    weight[:, 0, 1] += 1
    for n, part in enumerate(((place * along).sum(0), (slope * along).sum(0) / rods.rest[edge])):
        reach[:, n, 1], reach[:, n, 2] = -part, part
    return vertex, weight, reach, np.where(made[2] != 0, before, behind)


def _frame(x: np.ndarray, rods: Rods, bonds: Bonds) -> tuple[np.ndarray, Elements]:
    """Return the vertices (b, 8) of each bond, four about each edge, and what they count; h is empty."""
    first, one, along, clamp = _ends(rods, bonds.i, bonds.at)
    second, other, more, beside = _ends(rods, bonds.j, bonds.share)
    # a bond is from the second to the first; slopes are times the length of the second one's edge
    sign = np.column_stack([np.full(len(bonds.j), -1.0), rods.rest[bonds.j]])[:, :, None]
    same = np.column_stack([np.ones(len(bonds.j)), rods.rest[bonds.j]])[:, :, None]
    e = x[rods.b] - x[rods.a]
    t = e / np.linalg.norm(e, axis=1)[:, None]
    return np.column_stack([first, second]), Elements(
        np.zeros((0, 6, 6)),
        np.concatenate([same * one, sign * other], 2),
        np.concatenate([same * along, sign * more], 2),
        np.stack([t[clamp], t[beside]], 1),
    )


class Stiffness:
    """K over the free vertices, in blocks; bonds that were handed over need a new one."""

    def __init__(self, x: np.ndarray, rods: Rods, bonds: Bonds, free: np.ndarray) -> None:
        """Fix the pattern for free (v,) bool: vertices that are not held; clamps stand as at x (v, 3)."""
        p, q = rods.before, rods.after
        edge = np.column_stack([rods.a, rods.b, rods.b])
        hinge = np.column_stack([rods.a[p], rods.b[p], rods.b[q]])
        self._rods = np.concatenate([edge, hinge])
        self._bonds, self._frame = _frame(x, rods, bonds)
        self.size = int(free.sum())
        number = np.full(len(free), -1, np.int64)
        number[free] = np.arange(self.size)
        alone = np.arange(self.size, dtype=np.int64) * (self.size + 1)
        codes, inside = [alone], []
        for vertex in (self._rods, self._bonds):
            of = number[vertex]
            rows, columns = np.broadcast_arrays(of[:, :, None], of[:, None, :])
            inside.append((rows >= 0) & (columns >= 0))
            codes.append(rows[inside[-1]] * self.size + columns[inside[-1]])
        unique, at = np.unique(np.concatenate(codes), return_inverse=True)
        self.diagonal, done = at[: self.size], self.size
        self._place = []
        for own in inside:
            place = np.full(own.shape, -1, np.int64)
            place[own] = at[done : done + int(own.sum())]
            done += int(own.sum())
            self._place.append(place)
        self.indices = unique % max(self.size, 1)
        self.indptr = np.searchsorted(unique, np.arange(self.size + 1, dtype=np.int64) * self.size)

    def blocks(self, x: np.ndarray, rods: Rods, bonds: Bonds, diagonal: float = 0.0) -> np.ndarray:
        """Return the blocks (nnz, 3, 3) of K [N/m] at x (v, 3) with `diagonal` added."""
        out = np.zeros((len(self.indices), 3, 3))
        spread(edges(x, rods, self._rods), self._place[0], out)
        spread(joints(x, rods, bonds, self._bonds, self._frame), self._place[1], out)
        for c in range(3):
            out[self.diagonal, c, c] += diagonal
        return out

    def matrix(self, x: np.ndarray, rods: Rods, bonds: Bonds) -> sp.bsr_matrix:
        """Return K [N/m] over the free degrees of freedom."""
        data = self.blocks(x, rods, bonds)
        return sp.bsr_matrix((data, self.indices, self.indptr), shape=(3 * self.size, 3 * self.size))
