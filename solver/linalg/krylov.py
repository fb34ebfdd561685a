"""Conjugate gradients on matrices of 3 x 3 blocks, preconditioned by the inverses of the diagonal blocks."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints

__all__ = ["conjugate_gradients", "times"]


@njit(cache=True)
def _times(indptr: Ints, indices: Ints, a: Floats, p: Floats, y: Floats) -> float:
    """Write A p to y and return p . A p."""
    total = 0.0
    for i in range(len(p)):
        s0 = s1 = s2 = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            q0, q1, q2 = p[j, 0], p[j, 1], p[j, 2]
            s0 += a[k, 0, 0] * q0 + a[k, 0, 1] * q1 + a[k, 0, 2] * q2
            s1 += a[k, 1, 0] * q0 + a[k, 1, 1] * q1 + a[k, 1, 2] * q2
            s2 += a[k, 2, 0] * q0 + a[k, 2, 1] * q1 + a[k, 2, 2] * q2
        y[i, 0], y[i, 1], y[i, 2] = s0, s1, s2
        total += s0 * p[i, 0] + s1 * p[i, 1] + s2 * p[i, 2]
    return total


@njit(cache=True)
def conjugate_gradients(
    indptr: Ints, indices: Ints, diagonal: Ints, a: Floats, b: Floats, tolerance: float, most: int
) -> tuple[Floats, int, bool]:
    """Return x (n, 3) with A x = b, the iterations it took, and whether A curved upwards in every direction met.

    |b - A x| <= tolerance |b| in the preconditioner's norm. a: blocks (nnz, 3, 3) in compressed rows `indptr`,
    `indices`; diagonal: places of the diagonal blocks, whose inverses M precondition. What has been found so far is
    returned after `most` iterations, or at a direction in which A does not curve upwards. Hestenes and Stiefel 1952.
    """
    n = len(b)
    inverse = np.empty((n, 3, 3))
    for i in range(n):
        inverse[i] = np.linalg.inv(a[diagonal[i]])
    x, p, Ap = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    r, z = b.copy(), np.empty((n, 3))
    rz = first = 0.0
    for iteration in range(most):
        before, rz = rz, 0.0
        for i in range(n):
            for c in range(3):
                z[i, c] = inverse[i, c, 0] * r[i, 0] + inverse[i, c, 1] * r[i, 1] + inverse[i, c, 2] * r[i, 2]
                rz += z[i, c] * r[i, c]
        if iteration == 0:
            first = rz
        if rz <= tolerance * tolerance * first or rz == 0:
            return x, iteration, True
        beta = rz / before if iteration > 0 else 0.0
        for i in range(n):
            for c in range(3):
                p[i, c] = z[i, c] + beta * p[i, c]
        pAp = _times(indptr, indices, a, p, Ap)
        if not pAp > 0:
            if iteration == 0:
                x[:] = z
            return x, iteration + 1, False
        alpha = rz / pAp
        for i in range(n):
            for c in range(3):
                x[i, c] += alpha * p[i, c]
                r[i, c] -= alpha * Ap[i, c]
    return x, most, True


def times(indptr: Ints, indices: Ints, a: Floats, x: Floats) -> Floats:
    """Return A x (n, 3) of blocks a (nnz, 3, 3)."""
    y = np.empty_like(x)
    _times(indptr, indices, a, x, y)
    return y
