"""Neo-Hookean tetrahedra: energy, gradient and a Hessian that is never indefinite, on constant strain.

    W = mu/2 (|F|^2 - 3 - 2 ln J) + lambda/2 (ln J)^2,   F = (edges now) (edges at rest)^-1     (solver.material)

W is infinite for an inverted tetrahedron, so no equilibrium holds one. The Hessian's term in dW/dJ is cut where its
eigenvalues (the singular values of F, Smith et al. 2019) would outweigh mu: Newton's step then always leads down.
Energies are in units of (stiffness) r1^3, forces in (stiffness) r1^2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from ...fem import tetrahedron_gradients
from ...linalg.patterns import of_cliques, places

__all__ = ["Blocks", "blocks", "energy", "forces", "hessian", "inverse_edges"]


#: Share of its volume at rest below which a tetrahedron counts as flat: on the way to rest one that a step has pressed
#: to 1e-8 has a stiffness in which that of its neighbours is lost to rounding. None in equilibrium is near it.
_FLAT = 1e-3


class Blocks(NamedTuple):
    """Sparsity of a matrix of 3 x 3 blocks over the points of tetrahedra.

    indptr, indices: compressed rows of the neighbours of each point, itself among them; diagonal (p): where the
    diagonal blocks stand; slot (t, 4, 4): where the block of two corners of a tetrahedron stands.
    """

    indptr: Ints
    indices: Ints
    diagonal: Ints
    slot: Ints


def blocks(tets: Ints, count: int) -> Blocks:
    """Return the sparsity of tetrahedra on `count` points."""
    found = of_cliques(tets, count)
    return Blocks(*found, places(tets, found.indptr, found.indices))


def inverse_edges(points: Floats, tets: Ints) -> Floats:
    """Return the inverses (t, 3, 3) of the edge matrices, whose columns are the edges from the first corner."""
    edges = np.einsum("tai,ak->tik", points[tets], tetrahedron_gradients())
    return np.asarray(np.linalg.inv(edges), dtype=np.float64)


@njit(cache=True)
def _gradient(x: Floats, corners: Floats, inverse: Floats, f: Floats) -> None:
    """Write the deformation gradient of one tetrahedron with four corners to f (3, 3)."""
    for i in range(3):
        for j in range(3):
            f[i, j] = 0.0
            for k in range(3):
                f[i, j] += (x[corners[k + 1], i] - x[corners[0], i]) * inverse[k, j]


@njit(cache=True)
def _cofactor(f: Floats, c: Floats) -> float:
    """Write the cofactors of f to c and return the determinant."""
    for i in range(3):
        p, q = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            r, s = (j + 1) % 3, (j + 2) % 3
            c[i, j] = f[p, r] * f[q, s] - f[p, s] * f[q, r]
    found: float = f[0, 0] * c[0, 0] + f[0, 1] * c[0, 1] + f[0, 2] * c[0, 2]
    return found


@njit(cache=True)
def energy(x: Floats, tets: Ints, inverse: Floats, volume: Floats, mu: Floats, lam: Floats) -> float:
    """Return the energy of points x (p, 3); infinite if a tetrahedron is as good as flat, or inverted. mu, lam: (t)."""
    f, c = np.empty((3, 3)), np.empty((3, 3))
    total = 0.0
    for t in range(len(tets)):
        _gradient(x, tets[t], inverse[t], f)
        j = _cofactor(f, c)
        if not j > _FLAT:
            return np.inf
        size = 0.0
        for a in range(3):
            for b in range(3):
                size += f[a, b] * f[a, b]
        log = np.log(j)
        total += volume[t] * (0.5 * mu[t] * (size - 3 - 2 * log) + 0.5 * lam[t] * log * log)
    return total


@njit(cache=True)
def forces(
    x: Floats, tets: Ints, inverse: Floats, volume: Floats, mu: Floats, lam: Floats, g: Floats, scale: Floats
) -> float:
    """Add the energy's gradient to g (p, 3) and the sizes of its shares to scale (p); return the least J."""
    f, c, stress = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    least = np.inf
    for t in range(len(tets)):
        _gradient(x, tets[t], inverse[t], f)
        j = _cofactor(f, c)
        least = min(least, j)
        slope = (lam[t] * np.log(j) - mu[t]) / j
        for a in range(3):
            for b in range(3):
                stress[a, b] = volume[t] * (mu[t] * f[a, b] + slope * c[a, b])
        first0 = first1 = first2 = 0.0
        for k in range(3):
            h0 = stress[0, 0] * inverse[t, k, 0] + stress[0, 1] * inverse[t, k, 1] + stress[0, 2] * inverse[t, k, 2]
            h1 = stress[1, 0] * inverse[t, k, 0] + stress[1, 1] * inverse[t, k, 1] + stress[1, 2] * inverse[t, k, 2]
            h2 = stress[2, 0] * inverse[t, k, 0] + stress[2, 1] * inverse[t, k, 1] + stress[2, 2] * inverse[t, k, 2]
            i = tets[t, k + 1]
            g[i, 0] += h0
            g[i, 1] += h1
            g[i, 2] += h2
            scale[i] += np.sqrt(h0 * h0 + h1 * h1 + h2 * h2)
            first0 += h0
            first1 += h1
            first2 += h2
        i = tets[t, 0]
        g[i, 0] -= first0
        g[i, 1] -= first1
        g[i, 2] -= first2
        scale[i] += np.sqrt(first0 * first0 + first1 * first1 + first2 * first2)
    return least


@njit(cache=True)
def _longest(f: Floats) -> float:
    """Return the largest singular value of f: the largest root of the characteristic cubic of f^T f."""
    a = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                a[i, j] += f[k, i] * f[k, j]
    mean = (a[0, 0] + a[1, 1] + a[2, 2]) / 3
    d0, d1, d2 = a[0, 0] - mean, a[1, 1] - mean, a[2, 2] - mean
    off = a[0, 1] * a[0, 1] + a[0, 2] * a[0, 2] + a[1, 2] * a[1, 2]
    spread = np.sqrt((d0 * d0 + d1 * d1 + d2 * d2 + 2 * off) / 6)
    if spread <= 1e-14 * mean:
        return float(np.sqrt(mean))
    det = (
        d0 * (d1 * d2 - a[1, 2] * a[1, 2])
        - a[0, 1] * (a[0, 1] * d2 - a[1, 2] * a[0, 2])
        + a[0, 2] * (a[0, 1] * a[1, 2] - d1 * a[0, 2])
    )
    angle = np.arccos(min(1.0, max(-1.0, det / (2 * spread**3)))) / 3
    return float(np.sqrt(mean + 2 * spread * np.cos(angle)))


@njit(cache=True)
def hessian(
    x: Floats, tets: Ints, inverse: Floats, volume: Floats, mu: Floats, lam: Floats, slot: Ints, out: Floats, cut: bool
) -> None:
    """Add the Hessian to blocks out (b, 3, 3); `cut` keeps it from being indefinite (else it is the exact one)."""
    f, c = np.empty((3, 3)), np.empty((3, 3))
    n, m = np.empty((4, 3)), np.empty((4, 3))
    for t in range(len(tets)):
        _gradient(x, tets[t], inverse[t], f)
        j = _cofactor(f, c)
        log = np.log(j)
        slope = (lam[t] * log - mu[t]) / j
        bend = (lam[t] * (1 - log) + mu[t]) / (j * j)
        if cut:
            bound = mu[t] / _longest(f)
            slope = min(max(slope, -bound), bound)
            bend = max(bend, 0.0)
        for b in range(3):
            n[0, b] = -inverse[t, 0, b] - inverse[t, 1, b] - inverse[t, 2, b]
            for k in range(3):
                n[k + 1, b] = inverse[t, k, b]
        for k in range(4):
            for a in range(3):
                m[k, a] = c[a, 0] * n[k, 0] + c[a, 1] * n[k, 1] + c[a, 2] * n[k, 2]
        for k in range(4):
            for q in range(4):
                block = out[slot[t, k, q]]
                straight = volume[t] * mu[t] * (n[k, 0] * n[q, 0] + n[k, 1] * n[q, 1] + n[k, 2] * n[q, 2])
                for a in range(3):
                    block[a, a] += straight
                    for b in range(3):
                        block[a, b] += volume[t] * bend * m[k, a] * m[q, b]
                if k != q:
                    s = volume[t] * slope
                    r0 = n[k, 1] * n[q, 2] - n[k, 2] * n[q, 1]
                    r1 = n[k, 2] * n[q, 0] - n[k, 0] * n[q, 2]
                    r2 = n[k, 0] * n[q, 1] - n[k, 1] * n[q, 0]
                    w0 = s * (f[0, 0] * r0 + f[0, 1] * r1 + f[0, 2] * r2)
                    w1 = s * (f[1, 0] * r0 + f[1, 1] * r1 + f[1, 2] * r2)
                    w2 = s * (f[2, 0] * r0 + f[2, 1] * r1 + f[2, 2] * r2)
                    block[0, 1] += w2
                    block[0, 2] -= w1
                    block[1, 0] -= w2
                    block[1, 2] += w0
                    block[2, 0] += w1
                    block[2, 1] -= w0
