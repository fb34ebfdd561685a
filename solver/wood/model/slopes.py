"""The slopes of rods at their vertices: of the parabola through a vertex and its neighbours, by rest lengths.

A bond is sheared by the mean slope of both rods that it joins. By the slope of one alone, two rods that turn apart, as
the faces of a crack that opens, would be sheared, and hold together by what no crack has.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Rods

__all__ = ["leaning", "parabolas"]


@njit(cache=True, error_model="numpy")
def parabolas(rods: Rods, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the two edges (v, 2) that make up the slope at each of `count` vertices, and their factors (v, 2) [1/m].

    At a free end the parabola of the vertex beside it goes on; at a clamp the slope is the ghost edge's.
    """
    edge = np.zeros((count, 2), np.int32)
    factor = np.zeros((count, 2))
    before = np.full(len(rods.a), -1, np.int64)
    after = np.full(len(rods.a), -1, np.int64)
    for h in range(len(rods.before)):
        if rods.whole[h] == 1:
            before[rods.after[h]] = rods.before[h]
            after[rods.before[h]] = rods.after[h]
    for e in range(len(rods.a)):
        # stubs of a cut edge have no say
        if rods.k[e] == 0.0 or rods.alive[e] == 0:
            continue
        for end in range(2):
            i = rods.a[e] if end == 0 else rods.b[e]
            beside = before[e] if end == 0 else after[e]
            other = after[e] if end == 0 else before[e]
            h = rods.rest[e]
            edge[i, 0] = e
            edge[i, 1] = e
            if beside >= 0 and rods.k[beside] == 0.0:
                edge[i, 0] = beside
                factor[i, 0] = 1.0 / rods.rest[beside]
                factor[i, 1] = 0.0
            elif beside >= 0:
                g = rods.rest[beside]
                edge[i, 1] = beside
                factor[i, 0] = g / (h * (h + g))
                factor[i, 1] = h / (g * (h + g))
            elif other >= 0 and rods.k[other] > 0.0:
                g = rods.rest[other]
                edge[i, 1] = other
                factor[i, 0] = (1.0 + h / (h + g)) / h
                factor[i, 1] = -h / (g * (h + g))
            else:
                factor[i, 0] = 1.0 / h
                factor[i, 1] = 0.0
    return edge, factor


def leaning(x: np.ndarray, rods: Rods) -> np.ndarray:
    """Return the slopes (v, 3) of rods at vertices x (v, 3) [m], by length at rest."""
    edge, factor = parabolas(rods, len(x))
    e = x[rods.b] - x[rods.a]
    found: np.ndarray = (factor[:, :, None] * e[edge]).sum(1)
    return found
