"""Which edges of different rods are near each other."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...geometry.boxes import touching
from ...geometry.closest import of_segments
from ..model.arrays import Rods

__all__ = ["distances", "pairs"]


@njit(cache=True, error_model="numpy")
def _square(x: np.ndarray, a: int, b: int, c: int, d: int) -> float:
    """Return how far apart the segments a-b and c-d are, squared [m2]."""
    s, t = of_segments(x, a, b, c, d, 0.0)
    total = 0.0
    for k in range(3):
        g = (1.0 - s) * x[a, k] + s * x[b, k] - (1.0 - t) * x[c, k] - t * x[d, k]
        total += g * g
    return total


@njit(cache=True, error_model="numpy")
def _within(
    x: np.ndarray, first: np.ndarray, last: np.ndarray, rod: np.ndarray, near: np.ndarray, half: np.ndarray
) -> np.ndarray:
    """Return edge times edges plus edge (p,) of the pairs `near` (n, 2) of different rods within their halves [m]."""
    keys, count = np.empty(len(near), np.int64), 0
    for m in range(len(near)):
        e, w = min(near[m, 0], near[m, 1]), max(near[m, 0], near[m, 1])
        if rod[e] != rod[w] and _square(x, first[e], last[e], first[w], last[w]) < (half[e] + half[w]) ** 2:
            keys[count] = e * len(first) + w
            count += 1
    return keys[:count]


def pairs(x: np.ndarray, rods: Rods, rod: np.ndarray, reach: float, more: np.ndarray | None = None) -> np.ndarray:
    """Return the pairs (p, 2) of edges of different rods that are within `reach` [m], ascending.

    more (e,) [m]: by how much farther each edge reaches.
    """
    half = np.full(len(rods.a), 0.5 * reach) + (0.0 if more is None else more)
    live = np.flatnonzero((rods.alive == 1) & (rods.k > 0))
    a, b, wide = x[rods.a[live]], x[rods.b[live]], half[live, None]
    near = live[touching(np.minimum(a, b) - wide, np.maximum(a, b) + wide)]
    keys = np.sort(_within(x, rods.a, rods.b, rod, near, half))
    return np.stack(np.divmod(keys, len(rods.a)), -1).astype(np.int32)


@njit(cache=True, error_model="numpy")
def distances(x: np.ndarray, rods: Rods, pair: np.ndarray) -> np.ndarray:
    """Return how far apart the edges of each pair (p, 2) are [m]."""
    out = np.empty(len(pair))
    for m in range(len(pair)):
        a, b = rods.a[pair[m, 0]], rods.b[pair[m, 0]]
        c, d = rods.a[pair[m, 1]], rods.b[pair[m, 1]]
        out[m] = np.sqrt(_square(x, a, b, c, d))
    return out
