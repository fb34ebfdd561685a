"""How far a step may go before something touches: additive continuous collision detection.

Li, Kaufman, Jiang 2021, doi 10.1145/3450626.3459767, sec. 4: a stencil is moved on by what its distance surely allows,
again and again, until little of the distance is left.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from .distance import EDGES, nearest

__all__ = ["free_step", "largest"]

#: Share of a distance that a step may not take, and turns after which it ends where it has come to.
_LEFT, _TURNS = 0.1, 60


@njit(cache=True, error_model="numpy")
def free_step(x: Floats, way: Floats, stencils: Ints, kinds: Ints, longest: float) -> float:
    """Return how much of `way` (n, 3), at most `longest`, vertices at x (n, 3) may go; no stencil closes on the way."""
    w, gap = np.empty(4), np.empty(3)
    at, moves = np.empty((4, 3)), np.empty((4, 3))
    own = np.arange(4)
    allowed = longest
    for k in range(len(stencils)):
        q, kind = stencils[k], kinds[k]
        for d in range(3):
            mean = 0.0
            for i in range(4):
                at[i, d], moves[i, d] = x[q[i], d], way[q[i], d]
                mean += moves[i, d] / 4
            for i in range(4):
                moves[i, d] -= mean
        speed = _speed(moves, kind)
        if speed == 0.0:
            continue
        distance = np.sqrt(nearest(at, own, kind, w, gap))
        left = _LEFT * distance
        t = 0.0
        for _ in range(_TURNS):
            further = 0.9 * (distance - left) / speed
            if t + further >= allowed:
                t = allowed
                break
            t += further
            for i in range(4):
                for d in range(3):
                    at[i, d] += further * moves[i, d]
            distance = np.sqrt(nearest(at, own, kind, w, gap))
            if distance <= 1.1 * left:
                break
        allowed = min(allowed, t)
    return allowed


@njit(cache=True, error_model="numpy")
def _speed(moves: Floats, kind: int) -> float:
    """Return how fast the two parts of a stencil can near each other at most."""
    sizes = np.empty(4)
    for i in range(4):
        sizes[i] = np.sqrt(moves[i, 0] ** 2 + moves[i, 1] ** 2 + moves[i, 2] ** 2)
    found: float = sizes[0] + max(sizes[1], max(sizes[2], sizes[3]))
    if kind == EDGES:
        found = max(sizes[0], sizes[1]) + max(sizes[2], sizes[3])
    return found


@njit(cache=True, error_model="numpy")
def largest(moves: Floats, edges: Ints) -> tuple[float, float]:
    """Return the longest of moves (n, 3), and the largest difference between those of an edge's two ends."""
    move = change = 0.0
    for i in range(len(moves)):
        move = max(move, moves[i, 0] ** 2 + moves[i, 1] ** 2 + moves[i, 2] ** 2)
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        a, b, c = moves[i, 0] - moves[j, 0], moves[i, 1] - moves[j, 1], moves[i, 2] - moves[j, 2]
        change = max(change, a * a + b * b + c * c)
    return np.sqrt(move), np.sqrt(change)
