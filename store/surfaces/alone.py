"""Products of matrices on one thread: those that BLAS divides among threads wait for each other in a busy server, and
spin meanwhile, for a tenth of a millisecond's work.
"""

from __future__ import annotations

import numpy as np

from solver.arrays import Array

__all__ = ["MOST", "product", "total"]

#: Multiplications of a matrix product that BLAS leaves to one thread: OpenBLAS does to 4 x 65536.
MOST = 200_000


def product(a: Array, b: Array) -> Array:
    """Return a (n, k) times b (k, m), as BLAS would, in blocks of rows or columns."""
    (n, k), m = a.shape, b.shape[1]
    if n * k * m <= MOST:
        return a @ b
    found = np.empty((n, m), np.result_type(a, b))
    step = max(MOST // (k * min(n, m)), 1)
    if n < m:
        for first in range(0, m, step):
            np.matmul(a, b[:, first : first + step], out=found[:, first : first + step])
    else:
        for first in range(0, n, step):
            np.matmul(a[first : first + step], b, out=found[first : first + step])
    return found


def total(parts: Array, terms: Array) -> Array:
    """Return the sum (n,) of terms (t, n) times their parts (t,). BLAS divides even 10,000 products of these."""
    found: Array = np.einsum("t,tn->n", parts, terms)
    return found
