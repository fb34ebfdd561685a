"""Sparsity of matrices of blocks: which unknowns are coupled, and where the blocks of an element go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import csr_array

from ..arrays import Ints

__all__ = ["Sparsity", "distinct", "of_cliques", "of_pairs", "places"]


class Sparsity(NamedTuple):
    """Block rows (CSR), both triangles, columns rising; diagonal: (n,) where the diagonal blocks stand."""

    indptr: Ints
    indices: Ints
    diagonal: Ints


def distinct(keys: Ints) -> Ints:
    """Return the different keys, sorted: by sorting, which is many times faster than the hashing of numpy.unique."""
    found = np.sort(keys, axis=None)
    return found[np.concatenate([[True], found[1:] != found[:-1]])] if len(found) else found


def of_pairs(pairs: Ints, n: int) -> Sparsity:
    """Return the pattern of n unknowns of which `pairs` (m, 2) are coupled; each has its diagonal block."""
    keys = distinct(np.concatenate([pairs @ [n, 1], pairs @ [1, n], np.arange(n) * (n + 1)]))
    return Sparsity(
        np.searchsorted(keys // n, np.arange(n + 1)), keys % n, np.searchsorted(keys, np.arange(n) * (n + 1))
    )


def of_cliques(cliques: Ints, n: int) -> Sparsity:
    """Return the pattern of n unknowns, all of a row of `cliques` (m, c) coupled with each other; -1 for none."""
    rows, there = np.repeat(np.arange(len(cliques)), cliques.shape[1]), cliques.ravel() >= 0
    ones = np.ones(int(there.sum()), np.int32)
    touch = csr_array((ones, (rows[there], cliques.ravel()[there])), shape=(len(cliques), n))
    graph = (touch.T @ touch).tocsr()
    graph.sort_indices()
    indptr, indices = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    return Sparsity(indptr, indices, places(np.arange(n)[:, None], indptr, indices)[:, 0, 0])


@njit(cache=True)
def places(cliques: Ints, indptr: Ints, indices: Ints) -> Ints:
    """Return where the blocks of all pairs in rows of `cliques` (m, c) are, (m, c, c); -1 of pairs that have none."""
    width = cliques.shape[1]
    found = np.full((len(cliques), width, width), -1)
    for m in range(len(cliques)):
        for a in range(width):
            if cliques[m, a] < 0:
                continue
            begin, end = indptr[cliques[m, a]], indptr[cliques[m, a] + 1]
            for b in range(width):
                low, high = begin, end
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < cliques[m, b]:
                        low = middle + 1
                    else:
                        high = middle
                if low < end and indices[low] == cliques[m, b]:
                    found[m, a, b] = low
    return found
