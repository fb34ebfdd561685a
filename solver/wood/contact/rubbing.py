"""Contact between rods that no bond holds together: a penalty between closest points of two edges, and friction.

Edges are capsules of one thickness, somewhat below the least distance of rods in the section, so that nothing touches
as laid. The same force acts on both closest points, shared by the ends of their edges: linear momentum is kept to
round-off. Closest points of parallel edges jump: so the square of the distance is the least of that between points at s
and t plus a small weight of (s - 1/2)^2 + (t - 1/2)^2, which is smooth, costs the thickness 2.5 % where both edges end,
and has the force of the points themselves as its slope.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...geometry.closest import of_segments
from ..model.arrays import Rods, Rubbing
from .shapes import eased

__all__ = ["crossed", "rub"]

_TINY = 1e-30
#: Weight of places away from the middles of edges, over the thickness squared.
MIDDLE = 0.1


@njit(cache=True, error_model="numpy")
def crossed(
    x: np.ndarray, rods: Rods, pair: np.ndarray, thick: float, vertex: np.ndarray, weight: np.ndarray, way: np.ndarray
) -> float:
    """Write the vertices (4,) of two edges, their weights (4,) in the way (3,) between closest points [m].

    Returns the distance [m], at least the length of the way; infinite where an edge is severed.
    """
    e = pair[0]
    w = pair[1]
    if rods.alive[e] == 0 or rods.alive[w] == 0:
        return np.inf
    vertex[0], vertex[1], vertex[2], vertex[3] = rods.a[e], rods.b[e], rods.a[w], rods.b[w]
    middle = MIDDLE * thick * thick
    s, t = of_segments(x, vertex[0], vertex[1], vertex[2], vertex[3], middle)
    weight[0], weight[1], weight[2], weight[3] = 1.0 - s, s, t - 1.0, -t
    apart = middle * ((s - 0.5) ** 2 + (t - 0.5) ** 2)
    for c in range(3):
        way[c] = 0.0
        for k in range(4):
            way[c] += weight[k] * x[vertex[k], c]
        apart += way[c] * way[c]
    found: float = np.sqrt(apart)
    return found


@njit(cache=True, error_model="numpy")
def _beyond(x: np.ndarray, rods: Rods, e: int, w: int, thick: float) -> bool:
    """Return whether the boxes of two edges are farther apart than `thick` [m]: most listed pairs are, at each step."""
    a, b, c, d = rods.a[e], rods.b[e], rods.a[w], rods.b[w]
    for k in range(3):
        if (
            min(x[c, k], x[d, k]) - max(x[a, k], x[b, k]) > thick
            or min(x[a, k], x[b, k]) - max(x[c, k], x[d, k]) > thick
        ):
            return True
    return False


@njit(cache=True, error_model="numpy")
def rub(
    x: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    mass: np.ndarray,
    rods: Rods,
    rubbing: Rubbing,
    dt: float,
    power: np.ndarray,
) -> float:
    """Add contact forces to f (v, 3) [N] and what friction loses to power[1] [W]; return their energy [J]."""
    thick, stiff, friction, ease = rubbing.law[0], rubbing.law[1], rubbing.law[2], rubbing.law[3]
    energy = 0.0
    n = np.zeros(3)
    slide = np.zeros(3)
    vertex = np.zeros(4, np.int64)
    weight = np.zeros(4)
    for m in range(len(rubbing.pair)):
        if _beyond(x, rods, rubbing.pair[m, 0], rubbing.pair[m, 1], thick):
            continue
        apart = crossed(x, rods, rubbing.pair[m], thick, vertex, weight, n)
        gap = thick - apart
        if gap <= 0.0 or apart == 0.0:
            continue
        own, normal = eased(gap, stiff, ease)
        energy += own
        square = max(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], _TINY)
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
        drag = 0.0
        if slip > 0.0 and friction > 0.0:
            lightness = 0.0
            for k in range(4):
                lightness += weight[k] * weight[k] / mass[vertex[k]]
            # no more than what stops the slip in half a step
            drag = min(friction * normal, 0.5 * slip / (lightness * dt)) / slip
        power[1] += drag * slip * slip
        for c in range(3):
            push = normal * n[c] / apart - drag * slide[c]
            for k in range(4):
                f[vertex[k], c] += weight[k] * push
    return energy
