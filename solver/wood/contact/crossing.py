"""The stiffness of contacts between rods for the implicit scheme: four vertices a pair.

The square of the distance is the least of Q over the places s and t. With w the vertices' weights, P = w.x, B the mixed
second derivatives of Q by x and by the places that are not at an end, and C those by the places: the second derivative
of the square is 2 w w - B C^-1 B.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..forces.hessian import Stiffness
from ..model.arrays import Rods
from .bodies import eased
from .rubbing import MIDDLE, Rubbing, crossed

__all__ = ["Crossing", "crossings"]


@njit(cache=True, error_model="numpy")
def _places(
    x: np.ndarray, vertex: np.ndarray, weight: np.ndarray, way: np.ndarray, middle: float, b: np.ndarray, g: np.ndarray
) -> None:
    """Write half of B to b (12, 2) and of C^-1 B to g (12, 2); zero for a place at an end."""
    s = weight[1]
    t = -weight[3]
    free = np.array([0.0 < s < 1.0, 0.0 < t < 1.0])
    c = np.zeros((2, 2))
    c[0, 0] = middle
    c[1, 1] = middle
    for k in range(3):
        u = x[vertex[1], k] - x[vertex[0], k]
        v = x[vertex[3], k] - x[vertex[2], k]
        c[0, 0] += u * u
        c[1, 1] += v * v
        c[0, 1] -= u * v
        for n in range(4):
            b[3 * n + k, 0] = weight[n] * u if free[0] else 0.0
            b[3 * n + k, 1] = -weight[n] * v if free[1] else 0.0
        if free[0]:
            b[k, 0] -= way[k]
            b[3 + k, 0] += way[k]
        if free[1]:
            b[6 + k, 1] += way[k]
            b[9 + k, 1] -= way[k]
    if not (free[0] and free[1]):
        c[0, 1] = 0.0
    det = c[0, 0] * c[1, 1] - c[0, 1] * c[0, 1]
    for n in range(12):
        g[n, 0] = (c[1, 1] * b[n, 0] - c[0, 1] * b[n, 1]) / det
        g[n, 1] = (c[0, 0] * b[n, 1] - c[0, 1] * b[n, 0]) / det


@njit(cache=True, error_model="numpy")
def _crossings(
    x: np.ndarray,
    v: np.ndarray,
    rods: Rods,
    rubbing: Rubbing,
    dt: float,
    slow: float,
    positive: bool,
    vertices: np.ndarray,
    h: np.ndarray,
) -> int:
    """Write the vertices (n, 4) of pairs that touch and their stiffness (n, 12, 12); return their number."""
    thick, stiff, friction, ease = rubbing.law[0], rubbing.law[1], rubbing.law[2], rubbing.law[3]
    n = np.zeros(3)
    slide = np.zeros(3)
    weight = np.zeros(4)
    b = np.zeros((12, 2))
    g = np.zeros((12, 2))
    number = 0
    for m in range(len(rubbing.pair)):
        vertex = vertices[number]
        apart = crossed(x, rods, rubbing.pair[m], thick, vertex, weight, n)
        gap = thick - apart
        square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
        if gap <= 0.0 or square == 0.0:
            continue
        _, normal, second = eased(gap, stiff, ease)
        along = 0.0
        for c in range(3):
            slide[c] = 0.0
            for k in range(4):
                slide[c] += weight[k] * v[vertex[k], c]
            along += slide[c] * n[c]
        slip = 0.0
        for c in range(3):
            slide[c] -= along * n[c] / square
            slip += slide[c] * slide[c]
        slip = np.sqrt(slip)
        soft = min(slip / slow, 1.0)
        drag = friction * rubbing.lagged[m] / dt
        secant = drag * (2.0 - soft) / max(slip, slow)
        slope = drag * 2.0 * (1.0 - soft) / slow
        if positive:
            secant = drag / max(slip, 0.5 * slow)
            slope = secant
        else:
            _places(x, vertex, weight, n, MIDDLE * thick * thick, b, g)
            second += normal / apart
        for p in range(3):
            for q in range(3):
                one = 1.0 if p == q else 0.0
                value = second * n[p] * n[q] / (apart * apart) + secant * (one - n[p] * n[q] / square)
                if slip > 0.0:
                    value += (slope - secant) * slide[p] * slide[q] / (slip * slip)
                if not positive:
                    value -= normal / apart * one
                for k in range(4):
                    for j in range(4):
                        more = weight[k] * weight[j] * value
                        if not positive:
                            one_b = b[3 * k + p, 0] * g[3 * j + q, 0] + b[3 * k + p, 1] * g[3 * j + q, 1]
                            more += normal / apart * one_b
                        h[number, 3 * k + p, 3 * j + q] = more
        number += 1
    return number


@njit(cache=True)
def _times(vertices: np.ndarray, h: np.ndarray, way: np.ndarray, out: np.ndarray) -> None:
    for n in range(len(h)):
        for k in range(4):
            for p in range(3):
                value = 0.0
                for j in range(4):
                    for q in range(3):
                        value += h[n, 3 * k + p, 3 * j + q] * way[vertices[n, j], q]
                out[vertices[n, k], p] += value


class Crossing(NamedTuple):
    """The stiffness of contacts between rods, pair by pair."""

    vertices: np.ndarray  # (n, 4) int64
    h: np.ndarray  # (n, 12, 12) [N/m]

    def add(self, way: np.ndarray, out: np.ndarray) -> None:
        """Add the product with `way` to out, both (v, 3)."""
        _times(self.vertices, self.h, way, out)

    def spread(self, pattern: Stiffness, out: np.ndarray) -> None:
        """Add to the pattern's blocks out (nnz, 3, 3) what has a place there."""
        for p in range(4):
            for q in range(4):
                to = pattern.at(self.vertices[:, p], self.vertices[:, q])
                np.add.at(out, to[to >= 0], self.h[to >= 0, 3 * p : 3 * p + 3, 3 * q : 3 * q + 3])

    def couples(self) -> np.ndarray:
        """Return the vertices (m, 2) of different edges that it couples."""
        one = self.vertices[:, [0, 0, 1, 1]].ravel()
        return np.unique(np.column_stack([one, self.vertices[:, [2, 3, 2, 3]].ravel()]), axis=0)


def crossings(
    x: np.ndarray, v: np.ndarray, rods: Rods, rubbing: Rubbing, dt: float, slow: float, positive: bool
) -> Crossing:
    """Return the stiffness of contacts between rods at x, v (v, 3).

    slow [m/s]: slip at which friction has its full size; positive: as the factor needs it.
    """
    count = len(rubbing.pair)
    vertices, h = np.zeros((count + 1, 4), np.int64), np.empty((count, 12, 12))
    number = _crossings(x, v, rods, rubbing, dt, slow, positive, vertices, h)
    return Crossing(vertices[:number], h[:number])
