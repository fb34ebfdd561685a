"""Which edges of different rods are near each other, from a grid."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import Rods
from .rubbing import closest

__all__ = ["distances", "pairs"]


@njit(cache=True, error_model="numpy")
def _near(x: np.ndarray, rods: Rods, rod: np.ndarray, cell: np.ndarray, order: np.ndarray, reach: float) -> np.ndarray:
    """Return pairs (p, 2) of edges of different rods within `reach` [m]; `order` sorts live edges by cell (e, 3)."""
    found = []
    count = len(order)
    for m in range(count):
        e = order[m]
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                # cells along z are neighbours in the order: one search for three of them
                low, high = 0, count
                k0, k1, k2 = cell[e, 0] + dx, cell[e, 1] + dy, cell[e, 2] - 1
                while low < high:
                    mid = (low + high) // 2
                    w = order[mid]
                    less = cell[w, 0] < k0 or (
                        cell[w, 0] == k0 and (cell[w, 1] < k1 or (cell[w, 1] == k1 and cell[w, 2] < k2))
                    )
                    if less:
                        low = mid + 1
                    else:
                        high = mid
                for n in range(low, count):
                    w = order[n]
                    if cell[w, 0] != k0 or cell[w, 1] != k1 or cell[w, 2] > k2 + 2:
                        break
                    if w <= e or rod[w] == rod[e]:
                        continue
                    a, b, c, d = rods.a[e], rods.b[e], rods.a[w], rods.b[w]
                    s, t = closest(x, a, b, c, d, 0.0)
                    apart = 0.0
                    for k in range(3):
                        g = (1.0 - s) * x[a, k] + s * x[b, k] - (1.0 - t) * x[c, k] - t * x[d, k]
                        apart += g * g
                    if apart < reach * reach:
                        found.append((e, w))
    out = np.empty((len(found), 2), np.int32)
    for m in range(len(found)):
        out[m, 0] = found[m][0]
        out[m, 1] = found[m][1]
    return out


def pairs(x: np.ndarray, rods: Rods, rod: np.ndarray, reach: float) -> np.ndarray:
    """Return the pairs (p, 2) of edges of different rods that are within `reach` [m]."""
    live = np.flatnonzero((rods.alive == 1) & (rods.k > 0))
    if not len(live):
        return np.zeros((0, 2), np.int32)
    a, b = x[rods.a], x[rods.b]
    size = float(np.linalg.norm(b[live] - a[live], axis=1).max()) + reach
    cell = np.floor((a + b) / (2 * size)).astype(np.int64)
    order = live[np.lexsort(cell[live].T[::-1])]
    found: np.ndarray = _near(x, rods, rod, cell, order, reach)
    return found[np.lexsort(found.T[::-1])]


@njit(cache=True, error_model="numpy")
def distances(x: np.ndarray, rods: Rods, pair: np.ndarray) -> np.ndarray:
    """Return how far apart the edges of each pair (p, 2) are [m]."""
    out = np.empty(len(pair))
    for m in range(len(pair)):
        a, b = rods.a[pair[m, 0]], rods.b[pair[m, 0]]
        c, d = rods.a[pair[m, 1]], rods.b[pair[m, 1]]
        s, t = closest(x, a, b, c, d, 0.0)
        apart = 0.0
        for k in range(3):
            g = (1.0 - s) * x[a, k] + s * x[b, k] - (1.0 - t) * x[c, k] - t * x[d, k]
            apart += g * g
        out[m] = np.sqrt(apart)
    return out
