"""Second derivatives of edges, hinges and bonds, element by element: of two vectors that a few vertices make up.

Bending is a function of the cosine C between two edges d and e. With unit vectors u and v, a = v - C u and
b = u - C v: dC/dd = a / |d|, dC/de = b / |e|, and the second derivatives are -(a u + u a + C (1 - u u)) / |d|^2,
(1 - v v - u b) / |d||e| and -(b v + v b + C (1 - v v)) / |e|^2. Shear is one of f = t.u with the bond d and the curve's
slope t: df/dd = (t - f u) / |d|, df/dt = u.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..model.arrays import Bonds, Rods

__all__ = ["Elements", "edges", "joints", "spread"]

_TINY = 1e-30


class Elements(NamedTuple):
    """Elements (n,) of two vectors that w vertices make up; what a clamp's direction lets through counts besides."""

    h: np.ndarray  # (n, 6, 6) second derivatives by the two vectors [N/m]
    weight: np.ndarray  # (n, 2, w) what each vertex counts in each vector
    along: np.ndarray  # (n, 2, w) what each vertex counts in each vector along `clamp`
    clamp: np.ndarray  # (n, 2, 3) unit vectors, of the first half of the vertices and of the second


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
def _rods(x: np.ndarray, rods: Rods, vertex: np.ndarray, h: np.ndarray, weight: np.ndarray) -> None:
    u = np.zeros(3)
    v = np.zeros(3)
    for n in range(len(rods.a)):
        weight[n, 0, 0] = -1.0
        weight[n, 0, 1] = 1.0
        if rods.alive[n] == 0 or rods.k[n] == 0.0:
            continue
        length = _unit(x, vertex[n], weight[n, 0], u)
        pull = rods.k[n] * (length / rods.rest[n] - rods.free[n]) / length
        for r in range(3):
            for c in range(3):
                h[n, r, c] = (rods.k[n] / rods.rest[n] - pull) * u[r] * u[c] + (pull if r == c else 0.0)
    base = len(rods.a)
    for n in range(len(rods.before)):
        m = base + n
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


@njit(cache=True, error_model="numpy")
def _bonds(d: np.ndarray, t: np.ndarray, rest: np.ndarray, bonds: Bonds, h: np.ndarray) -> None:
    """Write second derivatives (b, 6, 6) by bonds d (b, 3) [m] and mean slopes t (b, 3) times lengths rest (b,) [m]."""
    u = np.zeros(3)
    a = np.zeros(3)
    for n in range(len(d)):
        length = np.sqrt(max(d[n, 0] ** 2 + d[n, 1] ** 2 + d[n, 2] ** 2, _TINY))
        keep = 1.0 - bonds.damage[n]
        # what is damaged resists pressure as before
        spring = bonds.k[n] if length < bonds.rest[n] else keep * bonds.k[n]
        if bonds.on[n] == 0:
            continue
        slope = 0.0
        for c in range(3):
            u[c] = d[n, c] / length
            slope += t[n, c] * u[c]
        for c in range(3):
            a[c] = (t[n, c] - slope * u[c]) / length
        stiff = 2.0 * keep * bonds.s[n] / rest[n] ** 2
        turn = stiff * (slope - bonds.cosine[n] * rest[n]) / length
        pull = spring * (length / bonds.rest[n] - 1.0) / length
        for r in range(3):
            for c in range(3):
                one = 1.0 if r == c else 0.0
                both = t[n, r] * u[c] + u[r] * t[n, c]
                h[n, r, c] = (
                    (spring / bonds.rest[n] - pull) * u[r] * u[c]
                    + pull * one
                    + stiff * a[r] * a[c]
                    + turn * (3.0 * slope * u[r] * u[c] - slope * one - both) / length
                )
                h[n, 3 + r, 3 + c] = stiff * u[r] * u[c]
                h[n, r, 3 + c] = stiff * a[r] * u[c] + turn * (one - u[r] * u[c])
                h[n, 3 + c, r] = h[n, r, 3 + c]


def edges(x: np.ndarray, rods: Rods, vertex: np.ndarray) -> Elements:
    """Return edges and then hinges at x (v, 3), of three vertices (n, 3) each; an edge has the last one twice."""
    count = len(rods.a) + len(rods.before)
    out = Elements(np.zeros((count, 6, 6)), np.zeros((count, 2, 3)), np.zeros((count, 2, 3)), np.zeros((count, 2, 3)))
    _rods(x, rods, vertex, out.h, out.weight)
    return out


def joints(x: np.ndarray, rods: Rods, bonds: Bonds, vertex: np.ndarray, made: Elements) -> Elements:
    """Return the bonds at x (v, 3), of vertices (b, 8), in the frame of `made`, whose h is not read."""
    y = x[vertex]
    both = np.einsum("bpw,bwc->bpc", made.weight, y)
    wide = vertex.shape[1] // 2
    for n, mine in enumerate((slice(wide), slice(wide, None))):
        reach = np.einsum("bpw,bwc,bc->bp", made.along[:, :, mine], y[:, mine], made.clamp[:, n])
        both += reach[:, :, None] * made.clamp[:, n, None]
    h = np.zeros((len(bonds.i), 6, 6))
    _bonds(both[:, 0], both[:, 1], 2 * rods.rest[bonds.j], bonds, h)
    return made._replace(h=h)


@njit(cache=True, error_model="numpy")
def spread(parts: Elements, place: np.ndarray, out: np.ndarray) -> None:
    """Add the elements to the blocks out (nnz, 3, 3) at `place` (n, w, w); -1 where a vertex is held."""
    wide = parts.weight.shape[2]
    for n in range(len(parts.h)):
        h = parts.h[n]
        for k in range(wide):
            g = parts.clamp[n, 2 * k // wide]
            for m in range(wide):
                e = parts.clamp[n, 2 * m // wide]
                at = place[n, k, m]
                if at < 0:
                    continue
                for p in range(2):
                    for q in range(2):
                        w, z = parts.weight[n, p, k], parts.weight[n, q, m]
                        a, b = parts.along[n, p, k], parts.along[n, q, m]
                        if w != 0.0 and z != 0.0:
                            for r in range(3):
                                for c in range(3):
                                    out[at, r, c] += w * z * h[3 * p + r, 3 * q + c]
                        if a == 0.0 and b == 0.0:
                            continue
                        # (w + a g g) H (z + b e e) less w z H
                        whole = 0.0
                        for r in range(3):
                            for c in range(3):
                                whole += g[r] * h[3 * p + r, 3 * q + c] * e[c]
                        for r in range(3):
                            for c in range(3):
                                left = 0.0
                                right = 0.0
                                for s in range(3):
                                    left += g[s] * h[3 * p + s, 3 * q + c]
                                    right += h[3 * p + r, 3 * q + s] * e[s]
                                out[at, r, c] += (
                                    a * z * g[r] * left + w * b * right * e[c] + a * b * whole * g[r] * e[c]
                                )
