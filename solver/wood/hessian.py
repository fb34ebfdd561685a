"""The stiffness matrix of straight rods and bonds, its pattern fixed as long as no vertex is added.

Hinges and bonds depend on two vectors each; the second derivatives are central differences of their own forces (error
1e-9 relative, enough for Newton's method), taken element by element, so that no formula has to be derived twice.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numba import njit

from .arrays import Bonds, Rods

__all__ = ["Stiffness"]

#: Difference over the edge's length.
_STEP = 1e-6


@njit(cache=True, error_model="numpy")
def _hinge(u: np.ndarray, stiff: float, g: np.ndarray) -> None:
    """Write dE/du (6,) of a hinge with edges u[:3], u[3:]; as `rods.bend`."""
    p = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    q = np.sqrt(u[3] * u[3] + u[4] * u[4] + u[5] * u[5])
    less = 0.0
    for c in range(3):
        d = u[3 + c] / q - u[c] / p
        less += 0.5 * d * d
    more = max(2.0 - less, 1e-9)
    w = 2.0 * stiff / (more * more)
    for c in range(3):
        d = u[3 + c] / q - u[c] / p
        g[c] = -w / p * (d + less * u[c] / p)
        g[3 + c] = -w / q * (less * u[3 + c] / q - d)


@njit(cache=True, error_model="numpy")
def _bond(u: np.ndarray, k: float, rest: float, s: float, cosine: float, g: np.ndarray) -> None:
    """Write dE/du (6,) of a bond with d = u[:3], e = u[3:]; as `bonds.bind`."""
    d2 = max(u[0] * u[0] + u[1] * u[1] + u[2] * u[2], 1e-30)
    e2 = max(u[3] * u[3] + u[4] * u[4] + u[5] * u[5], 1e-30)
    d = np.sqrt(d2)
    ide = 1.0 / np.sqrt(d2 * e2)
    c = (u[0] * u[3] + u[1] * u[4] + u[2] * u[5]) * ide
    w = 2.0 * s * (c - cosine)
    q = k * (d / rest - 1.0) / d - w * c / d2
    for n in range(3):
        g[n] = q * u[n] + w * ide * u[3 + n]
        g[3 + n] = w * ide * u[n] - w * c / e2 * u[3 + n]


@njit(cache=True, error_model="numpy")
def _spread(h: np.ndarray, weights: np.ndarray, out: np.ndarray) -> None:
    """Write the blocks (9, 9) of three vertices from h (6, 6) of two vectors with weights (2, 3)."""
    for k in range(3):
        for m in range(3):
            for r in range(3):
                for c in range(3):
                    total = 0.0
                    for p in range(2):
                        for q in range(2):
                            total += weights[p, k] * weights[q, m] * h[3 * p + r, 3 * q + c]
                    out[3 * k + r, 3 * m + c] = total


@njit(cache=True, error_model="numpy")
def _fill(x: np.ndarray, rods: Rods, bonds: Bonds, out: np.ndarray) -> None:
    """Write the element matrices (e + h + b, 9, 9): edges, hinges, bonds; zero where broken."""
    out[:] = 0.0
    for e in range(len(rods.a)):
        if rods.alive[e] == 0 or rods.k[e] == 0.0:
            continue
        d = x[rods.b[e]] - x[rods.a[e]]
        length = np.sqrt((d * d).sum())
        d /= length
        force = rods.k[e] * (length / rods.rest[e] - 1.0) / length
        for r in range(3):
            for c in range(3):
                value = (rods.k[e] / rods.rest[e] - force) * d[r] * d[c] + (force if r == c else 0.0)
                out[e, r, c] = value
                out[e, 3 + r, 3 + c] = value
                out[e, r, 3 + c] = -value
                out[e, 3 + r, c] = -value
    u = np.zeros(6)
    up = np.zeros(6)
    down = np.zeros(6)
    h = np.zeros((6, 6))
    weights = np.zeros((2, 3))
    base = len(rods.a)
    for n in range(len(rods.before)):
        if rods.whole[n] == 0:
            continue
        p = rods.before[n]
        q = rods.after[n]
        u[:3] = x[rods.b[p]] - x[rods.a[p]]
        u[3:] = x[rods.b[q]] - x[rods.a[q]]
        stiff = 4.0 * rods.alpha[n] / rods.span[n]
        for c in range(6):
            step = _STEP * rods.rest[p]
            was = u[c]
            u[c] = was + step
            _hinge(u, stiff, up)
            u[c] = was - step
            _hinge(u, stiff, down)
            u[c] = was
            h[c] = (up - down) / (2.0 * step)
        weights[:] = 0.0
        weights[0, 0] = -1.0
        weights[0, 1] = 1.0
        weights[1, 1] = -1.0
        weights[1, 2] = 1.0
        _spread(0.5 * (h + h.T), weights, out[base + n])
    base += len(rods.before)
    for n in range(len(bonds.i)):
        if bonds.on[n] == 0:
            continue
        a = rods.a[bonds.j[n]]
        b = rods.b[bonds.j[n]]
        s = bonds.share[n]
        u[:3] = x[bonds.i[n]] - (1.0 - s) * x[a] - s * x[b]
        u[3:] = x[b] - x[a]
        for c in range(6):
            step = _STEP * bonds.rest[n]
            was = u[c]
            u[c] = was + step
            _bond(u, bonds.k[n], bonds.rest[n], bonds.s[n], bonds.cosine[n], up)
            u[c] = was - step
            _bond(u, bonds.k[n], bonds.rest[n], bonds.s[n], bonds.cosine[n], down)
            u[c] = was
            h[c] = (up - down) / (2.0 * step)
        weights[0, 0] = 1.0
        weights[0, 1] = s - 1.0
        weights[0, 2] = -s
        weights[1, 0] = 0.0
        weights[1, 1] = -1.0
        weights[1, 2] = 1.0
        _spread(0.5 * (h + h.T), weights, out[base + n])


class Stiffness:
    """Assembles K over the free degrees of freedom; bonds that were handed over need a new one."""

    def __init__(self, rods: Rods, bonds: Bonds, free: np.ndarray) -> None:
        """Fix the pattern for free (v,) bool: vertices that are not held."""
        p, q = rods.before, rods.after
        edge = np.column_stack([rods.a, rods.b, rods.b])
        hinge = np.column_stack([rods.a[p], rods.b[p], rods.b[q]])
        bond = np.column_stack([bonds.i, rods.a[bonds.j], rods.b[bonds.j]])
        self._count = (len(edge) + len(hinge) + len(bond), 9, 9)
        number = np.full(3 * len(free), -1)
        self.free = np.repeat(free, 3)
        number[self.free] = np.arange(int(self.free.sum()))
        self.size = int(self.free.sum())
        dof = (3 * np.concatenate([edge, hinge, bond])[:, :, None] + np.arange(3)).reshape(-1, 9)
        dof = number[dof]
        rows = np.broadcast_to(dof[:, :, None], self._count)
        columns = np.broadcast_to(dof[:, None, :], self._count)
        self._inside = (rows >= 0) & (columns >= 0)
        # the third vertex of an edge is none
        self._inside[: len(edge), 6:] = False
        self._inside[: len(edge), :, 6:] = False
        code = columns[self._inside].astype(np.int64) * self.size + rows[self._inside]
        diagonal = np.arange(self.size, dtype=np.int64) * (self.size + 1)
        three = np.arange(3)
        first = np.flatnonzero(free)
        corner = number[3 * first[:, None] + three]
        blocks = (corner[:, None, :] * self.size + corner[:, :, None]).reshape(-1)
        unique, place = np.unique(np.concatenate([code, blocks]), return_inverse=True)
        self._place, self._block = place[: len(code)], place[len(code) :].reshape(-1, 3, 3)
        self._diagonal = np.searchsorted(unique, diagonal)
        self._nnz = len(unique)
        self._indices = (unique % self.size).astype(np.int32)
        self._pointer = np.searchsorted(unique, np.arange(self.size + 1, dtype=np.int64) * self.size).astype(np.int32)
        self._elements = np.zeros(self._count)

    def matrix(
        self,
        x: np.ndarray,
        rods: Rods,
        bonds: Bonds,
        diagonal: np.ndarray | float = 0.0,
        blocks: np.ndarray | None = None,
    ) -> sp.csc_matrix:
        """Return K [N/m] with `diagonal` (free dof,) and `blocks` (free vertices, 3, 3) added."""
        _fill(x, rods, bonds, self._elements)
        data = np.bincount(self._place, self._elements[self._inside], self._nnz)
        data[self._diagonal] = data[self._diagonal] + diagonal
        if blocks is not None:
            np.add.at(data, self._block, blocks)
        return sp.csc_matrix((data, self._indices, self._pointer), shape=(self.size, self.size))
