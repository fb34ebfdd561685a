"""Second derivatives of edges, hinges and bonds, element by element: of two vectors that three vertices make up.

Bending and shear are functions of the cosine C between two vectors d and e. With unit vectors u and v, a = v - C u and
b = u - C v: dC/dd = a / |d|, dC/de = b / |e|, and the second derivatives are -(a u + u a + C (1 - u u)) / |d|^2,
(1 - v v - u b) / |d||e| and -(b v + v b + C (1 - v v)) / |e|^2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..model.arrays import Bonds, Rods

__all__ = ["Elements", "elements", "spread"]

_TINY = 1e-30


class Elements(NamedTuple):
    """Edges, hinges and bonds, one after another."""

    h: np.ndarray  # (n, 6, 6) second derivatives by the two vectors [N/m]
    vertex: np.ndarray  # (n, 3) int32
    weight: np.ndarray  # (n, 2, 3) what each vertex counts in each vector


@njit(cache=True, error_model="numpy")
def _unit(x: np.ndarray, vertex: np.ndarray, weight: np.ndarray, out: np.ndarray) -> float:
    """Write the unit vector (3,) that `weight` (3,) makes of three vertices; return its length."""
    square = 0.0
    for c in range(3):
        value = 0.0
        for k in range(3):
            value += weight[k] * x[vertex[k], c]
        out[c] = value
        square += value * value
    length: float = np.sqrt(max(square, _TINY))
    for c in range(3):
        out[c] /= length
    return length


@njit(cache=True, error_model="numpy")
def _turned(u: np.ndarray, v: np.ndarray, p: float, q: float, once: float, twice: float, h: np.ndarray) -> None:
    """Write to h (6, 6) the second derivatives of E(C), with E' = once and E'' = twice; |d| = p and |e| = q."""
    cosine = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    for r in range(3):
        ar = v[r] - cosine * u[r]
        br = u[r] - cosine * v[r]
        for c in range(3):
            ac = v[c] - cosine * u[c]
            bc = u[c] - cosine * v[c]
            one = 1.0 if r == c else 0.0
            h[r, c] = (twice * ar * ac - once * (ar * u[c] + u[r] * ac + cosine * (one - u[r] * u[c]))) / (p * p)
            h[3 + r, 3 + c] = (twice * br * bc - once * (br * v[c] + v[r] * bc + cosine * (one - v[r] * v[c]))) / (
                q * q
            )
            h[r, 3 + c] = (twice * ar * bc + once * (one - v[r] * v[c] - u[r] * bc)) / (p * q)
            h[3 + c, r] = h[r, 3 + c]


@njit(cache=True, error_model="numpy")
def _fill(
    x: np.ndarray,
    rods: Rods,
    bonds: Bonds,
    h: np.ndarray,
    vertex: np.ndarray,
    weight: np.ndarray,
) -> None:
    u = np.zeros(3)
    v = np.zeros(3)
    for n in range(len(rods.a)):
        vertex[n, 0] = rods.a[n]
        vertex[n, 1] = rods.b[n]
        vertex[n, 2] = rods.b[n]
        weight[n, 0, 0] = -1.0
        weight[n, 0, 1] = 1.0
        if rods.alive[n] == 0 or rods.k[n] == 0.0:
            continue
        length = _unit(x, vertex[n], weight[n, 0], u)
        pull = rods.k[n] * (length / rods.rest[n] - 1.0) / length
        for r in range(3):
            for c in range(3):
                h[n, r, c] = (rods.k[n] / rods.rest[n] - pull) * u[r] * u[c] + (pull if r == c else 0.0)
    base = len(rods.a)
    for n in range(len(rods.before)):
        m = base + n
        vertex[m, 0] = rods.a[rods.before[n]]
        vertex[m, 1] = rods.b[rods.before[n]]
        vertex[m, 2] = rods.b[rods.after[n]]
        weight[m, 0, 0] = -1.0
        weight[m, 0, 1] = 1.0
        weight[m, 1, 1] = -1.0
        weight[m, 1, 2] = 1.0
        if rods.whole[n] == 0:
            continue
        p = _unit(x, vertex[m], weight[m, 0], u)
        q = _unit(x, vertex[m], weight[m, 1], v)
        more = max(1.0 + u[0] * v[0] + u[1] * v[1] + u[2] * v[2], 1e-9)
        stiff = 4.0 * rods.alpha[n] / rods.span[n]
        _turned(u, v, p, q, -2.0 * stiff / (more * more), 4.0 * stiff / (more * more * more), h[m])
    base += len(rods.before)
    for n in range(len(bonds.i)):
        m = base + n
        s = bonds.share[n]
        vertex[m, 0] = bonds.i[n]
        vertex[m, 1] = rods.a[bonds.j[n]]
        vertex[m, 2] = rods.b[bonds.j[n]]
        weight[m, 0, 0] = 1.0
        weight[m, 0, 1] = s - 1.0
        weight[m, 0, 2] = -s
        weight[m, 1, 1] = -1.0
        weight[m, 1, 2] = 1.0
        if bonds.on[n] == 0:
            continue
        p = _unit(x, vertex[m], weight[m, 0], u)
        q = _unit(x, vertex[m], weight[m, 1], v)
        off = u[0] * v[0] + u[1] * v[1] + u[2] * v[2] - bonds.cosine[n]
        pull = bonds.k[n] * (p / bonds.rest[n] - 1.0) / p
        _turned(u, v, p, q, 2.0 * bonds.s[n] * off, 2.0 * bonds.s[n], h[m])
        for r in range(3):
            for c in range(3):
                h[m, r, c] += (bonds.k[n] / bonds.rest[n] - pull) * u[r] * u[c] + (pull if r == c else 0.0)


def elements(x: np.ndarray, rods: Rods, bonds: Bonds) -> Elements:
    """Return the elements at x (v, 3)."""
    count = len(rods.a) + len(rods.before) + len(bonds.i)
    out = Elements(np.zeros((count, 6, 6)), np.zeros((count, 3), np.int32), np.zeros((count, 2, 3)))
    _fill(x, rods, bonds, *out)
    return out


@njit(cache=True, error_model="numpy")
def spread(parts: Elements, place: np.ndarray, out: np.ndarray) -> None:
    """Add the elements to the blocks out (nnz, 3, 3) at `place` (n, 3, 3); -1 where a vertex is held."""
    for n in range(len(parts.h)):
        for k in range(3):
            for m in range(3):
                at = place[n, k, m]
                if at < 0:
                    continue
                for p in range(2):
                    for q in range(2):
                        w = parts.weight[n, p, k] * parts.weight[n, q, m]
                        if w == 0.0:
                            continue
                        for r in range(3):
                            for c in range(3):
                                out[at, r, c] += w * parts.h[n, 3 * p + r, 3 * q + c]
