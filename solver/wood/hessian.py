"""The stiffness matrix of straight rods and bonds, its pattern fixed as long as no vertex is added.

Hinges and bonds depend on two vectors each; the second derivatives are central differences of their own forces (error
1e-9 relative, enough for Newton's method), taken element by element, so that no formula has to be derived twice.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numba import njit

from .arrays import Bonds, Rods

__all__ = ["Stiffness", "spread"]

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
def spread(h: np.ndarray, weights: np.ndarray, place: np.ndarray, out: np.ndarray) -> None:
    """Add h (6, 6) of two vectors, which three vertices make up with weights (2, 3), to the blocks out at `place`.

    place (3, 3): the block of two vertices in out (nnz, 3, 3); -1 if one is held.
    """
    for k in range(3):
        for m in range(3):
            n = place[k, m]
            if n < 0:
                continue
            for p in range(2):
                for q in range(2):
                    w = weights[p, k] * weights[q, m]
                    if w == 0.0:
                        continue
                    for r in range(3):
                        for c in range(3):
                            out[n, r, c] += w * h[3 * p + r, 3 * q + c]


@njit(cache=True, error_model="numpy")
def _fill(x: np.ndarray, rods: Rods, bonds: Bonds, place: np.ndarray, out: np.ndarray) -> None:
    """Add the second derivatives of edges, hinges and bonds to the blocks out (nnz, 3, 3)."""
    for e in range(len(rods.a)):
        if rods.alive[e] == 0 or rods.k[e] == 0.0:
            continue
        d = x[rods.b[e]] - x[rods.a[e]]
        length = np.sqrt((d * d).sum())
        d /= length
        force = rods.k[e] * (length / rods.rest[e] - 1.0) / length
        for k in range(2):
            for m in range(2):
                n = place[e, k, m]
                if n < 0:
                    continue
                sign = 1.0 if k == m else -1.0
                for r in range(3):
                    for c in range(3):
                        value = (rods.k[e] / rods.rest[e] - force) * d[r] * d[c] + (force if r == c else 0.0)
                        out[n, r, c] += sign * value
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
        spread(0.5 * (h + h.T), weights, place[base + n], out)
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
        spread(0.5 * (h + h.T), weights, place[base + n], out)


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
        self.place = np.full(inside.shape, -1, np.int64)
        self.place[inside] = at[: len(at) - self.size]
        self.diagonal = at[len(at) - self.size :]
        self.indices = unique % max(self.size, 1)
        self.indptr = np.searchsorted(unique, np.arange(self.size + 1, dtype=np.int64) * self.size)

    def blocks(self, x: np.ndarray, rods: Rods, bonds: Bonds, diagonal: float = 0.0) -> np.ndarray:
        """Return the blocks (nnz, 3, 3) of K [N/m] with `diagonal` added, on the pattern indptr, indices."""
        out = np.zeros((len(self.indices), 3, 3))
        _fill(x, rods, bonds, self.place, out)
        for c in range(3):
            out[self.diagonal, c, c] += diagonal
        return out

    def matrix(self, x: np.ndarray, rods: Rods, bonds: Bonds, diagonal: float = 0.0) -> sp.bsr_matrix:
        """Return K [N/m] with `diagonal` added, over the free degrees of freedom."""
        data = self.blocks(x, rods, bonds, diagonal)
        return sp.bsr_matrix((data, self.indices, self.indptr), shape=(3 * self.size, 3 * self.size))
