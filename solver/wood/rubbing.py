"""Contact between rods that no bond joins: pairs of edges from a grid, a penalty between closest points, friction.

Edges are capsules of one thickness, somewhat below the least distance of rods in the section, so that nothing touches
as laid. The same force acts on both closest points, shared by the ends of their edges: linear momentum is kept to
round-off. Pairs stay listed while no vertex has moved by half the list's margin (Verlet 1967).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arrays import Bonds, Rods

__all__ = ["Rubbing", "none", "pairs", "rub"]

_TINY = 1e-30


class Rubbing(NamedTuple):
    """Listed pairs and what a contact is made of."""

    pair: np.ndarray  # (p, 2) int32 edges
    law: np.ndarray  # (3,) thickness [m], stiffness [N/m], friction [1]


def none() -> Rubbing:
    """Return no pairs."""
    return Rubbing(np.zeros((0, 2), np.int32), np.zeros(3))


@njit(cache=True, error_model="numpy")
def _closest(x: np.ndarray, a: int, b: int, c: int, d: int) -> tuple[float, float]:
    """Return where the edges a-b and c-d are closest, each 0 to 1 (Ericson 2005, sec. 5.1.9)."""
    p = 0.0
    q = 0.0
    e = 0.0
    f = 0.0
    g = 0.0
    for k in range(3):
        u = x[b, k] - x[a, k]
        v = x[d, k] - x[c, k]
        r = x[a, k] - x[c, k]
        p += u * u
        q += v * v
        e += u * v
        f += u * r
        g += v * r
    det = p * q - e * e
    s = 0.5
    if det > 1e-9 * p * q:
        s = min(max((e * g - f * q) / det, 0.0), 1.0)
    t = (e * s + g) / max(q, _TINY)
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((e * t - f) / max(p, _TINY), 0.0), 1.0)
    return s, t


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
                    s, t = _closest(x, a, b, c, d)
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


def pairs(x: np.ndarray, rods: Rods, bonds: Bonds, rod: np.ndarray, reach: float) -> np.ndarray:
    """Return the pairs (p, 2) of edges of different rods that are within `reach` [m] and that no bond joins."""
    live = np.flatnonzero((rods.alive == 1) & (rods.k > 0))
    if not len(live):
        return np.zeros((0, 2), np.int32)
    a, b = x[rods.a], x[rods.b]
    size = float(np.linalg.norm(b[live] - a[live], axis=1).max()) + reach
    cell = np.floor((a + b) / (2 * size)).astype(np.int64)
    order = live[np.lexsort(cell[live].T[::-1])]
    found = _near(x, rods, rod, cell, order, reach)
    count = len(rods.a)
    on = np.flatnonzero(bonds.on == 1)
    # a bond joins an edge to both edges that end in its vertex
    ending = np.full((2, len(x)), -1, np.int64)
    ending[0, rods.a[live]] = live
    ending[1, rods.b[live]] = live
    one = ending[:, bonds.i[on]].ravel()
    other = np.tile(bonds.j[on].astype(np.int64), 2)
    joined = np.unique(np.minimum(one, other) * count + np.maximum(one, other))
    codes = found[:, 0].astype(np.int64) * count + found[:, 1]
    kept: np.ndarray = found[~np.isin(codes, joined)]
    return kept[np.lexsort(kept.T[::-1])]


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
    thick, stiff, friction = rubbing.law[0], rubbing.law[1], rubbing.law[2]
    energy = 0.0
    n = np.zeros(3)
    slide = np.zeros(3)
    vertex = np.zeros(4, np.int64)
    weight = np.zeros(4)
    for m in range(len(rubbing.pair)):
        e = rubbing.pair[m, 0]
        w = rubbing.pair[m, 1]
        if rods.alive[e] == 0 or rods.alive[w] == 0:
            continue
        vertex[0], vertex[1], vertex[2], vertex[3] = rods.a[e], rods.b[e], rods.a[w], rods.b[w]
        s, t = _closest(x, vertex[0], vertex[1], vertex[2], vertex[3])
        weight[0], weight[1], weight[2], weight[3] = 1.0 - s, s, t - 1.0, -t
        apart = 0.0
        for c in range(3):
            n[c] = 0.0
            for k in range(4):
                n[c] += weight[k] * x[vertex[k], c]
            apart += n[c] * n[c]
        apart = np.sqrt(apart)
        gap = thick - apart
        if gap <= 0.0 or apart == 0.0:
            continue
        energy += 0.5 * stiff * gap * gap
        along = 0.0
        for c in range(3):
            n[c] /= apart
            slide[c] = 0.0
            for k in range(4):
                slide[c] += weight[k] * v[vertex[k], c]
            along += slide[c] * n[c]
        slip = 0.0
        for c in range(3):
            slide[c] -= along * n[c]
            slip += slide[c] * slide[c]
        slip = np.sqrt(slip)
        drag = 0.0
        if slip > 0.0 and friction > 0.0:
            lightness = 0.0
            for k in range(4):
                lightness += weight[k] * weight[k] / mass[vertex[k]]
            # no more than what stops the slip in half a step
            drag = min(friction * stiff * gap, 0.5 * slip / (lightness * dt)) / slip
        power[1] += drag * slip * slip
        for c in range(3):
            push = stiff * gap * n[c] - drag * slide[c]
            for k in range(4):
                f[vertex[k], c] += weight[k] * push
    return energy
