"""Conjugate gradients on matrices of 3 x 3 blocks, preconditioned by the inverses of the diagonal blocks."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats, Ints

__all__ = ["solve", "times"]


@njit(cache=True)
def _times(start: Ints, near: Ints, a: Floats, p: Floats, y: Floats) -> float:
    """Write a p to y and return p . a p."""
    total = 0.0
    for i in range(len(p)):
        s0 = s1 = s2 = 0.0
        for k in range(start[i], start[i + 1]):
            j = near[k]
            q0, q1, q2 = p[j, 0], p[j, 1], p[j, 2]
            s0 += a[k, 0, 0] * q0 + a[k, 0, 1] * q1 + a[k, 0, 2] * q2
            s1 += a[k, 1, 0] * q0 + a[k, 1, 1] * q1 + a[k, 1, 2] * q2
            s2 += a[k, 2, 0] * q0 + a[k, 2, 1] * q1 + a[k, 2, 2] * q2
        y[i, 0], y[i, 1], y[i, 2] = s0, s1, s2
        total += s0 * p[i, 0] + s1 * p[i, 1] + s2 * p[i, 2]
    return total


@njit(cache=True)
def solve(
    start: Ints, near: Ints, own: Ints, a: Floats, b: Floats, tolerance: float, most: int
) -> tuple[Floats, int, bool]:
    """Return x (p, 3) with a x = b, the iterations it took, and whether `a` curved upwards in every direction met.

    |b - a x| <= tolerance |b| in the preconditioner's norm.
    a: blocks (n, 3, 3) in compressed rows `start`, `near`; own: places of the diagonal blocks. What has been found
    so far is returned after `most` iterations, or at a direction in which `a` does not.
    """
    count = len(b)
    inverse = np.empty((count, 3, 3))
    for i in range(count):
        inverse[i] = np.linalg.inv(a[own[i]])
    x, y = np.zeros((count, 3)), np.zeros((count, 3))
    r, z = b.copy(), np.empty((count, 3))
    p = np.zeros((count, 3))
    before = first = 0.0
    for turn in range(most):
        now = 0.0
        for i in range(count):
            for c in range(3):
                z[i, c] = inverse[i, c, 0] * r[i, 0] + inverse[i, c, 1] * r[i, 1] + inverse[i, c, 2] * r[i, 2]
                now += z[i, c] * r[i, c]
        if turn == 0:
            first = now
        if now <= tolerance * tolerance * first or now == 0:
            return x, turn, True
        share = now / before if turn > 0 else 0.0
        for i in range(count):
            for c in range(3):
                p[i, c] = z[i, c] + share * p[i, c]
        curve = _times(start, near, a, p, y)
        if not curve > 0:
            if turn == 0:
                x[:] = z
            return x, turn + 1, False
        step = now / curve
        for i in range(count):
            for c in range(3):
                x[i, c] += step * p[i, c]
                r[i, c] -= step * y[i, c]
        before = now
    return x, most, True


def times(start: Ints, near: Ints, a: Floats, x: Floats) -> Floats:
    """Return a x (p, 3)."""
    y = np.empty_like(x)
    _times(start, near, a, x, y)
    return y
