"""A stale factor as preconditioner: the bundle as it stood when it was factored, in single precision.

Gauss and Newton's part of the stiffness is positive, so that Cholesky's factor exists whatever buckles. Every front of
the factor is kept as one matrix G = (L^-1; L21 L^-1): a solve is two products per front and no recurrence. In single
precision it reads half the memory, which is all its cost, and the outer iteration does not feel the difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.linalg import lapack

from ..multifrontal import Factor, factorise
from .arrays import Bonds, Rods
from .dissection import dissected
from .hessian import Stiffness, spread

__all__ = ["Preconditioner", "preconditioner"]


@njit(cache=True, error_model="numpy")
def _gauss(x: np.ndarray, rods: Rods, bonds: Bonds, place: np.ndarray, out: np.ndarray) -> None:
    """Add Gauss and Newton's part of the second derivatives, and that of tension, to the blocks out (nnz, 3, 3)."""
    h = np.zeros((6, 6))
    weights = np.zeros((2, 3))
    weights[0, 0] = -1.0
    weights[0, 1] = 1.0
    weights[1, 1] = -1.0
    weights[1, 2] = 1.0
    for n in range(len(rods.a)):
        if rods.alive[n] == 0 or rods.k[n] == 0.0:
            continue
        d = x[rods.b[n]] - x[rods.a[n]]
        length = np.sqrt((d * d).sum())
        d /= length
        pull = max(rods.k[n] * (length / rods.rest[n] - 1.0) / length, 0.0)
        for r in range(3):
            for c in range(3):
                h[r, c] = (rods.k[n] / rods.rest[n] - pull) * d[r] * d[c] + (pull if r == c else 0.0)
                h[r, 3 + c] = 0.0
                h[3 + r, c] = 0.0
                h[3 + r, 3 + c] = 0.0
        spread(h, weights, place[n], out)
    base = len(rods.a)
    for n in range(len(rods.before)):
        if rods.whole[n] == 0:
            continue
        p = rods.before[n]
        q = rods.after[n]
        u = x[rods.b[p]] - x[rods.a[p]]
        w = x[rods.b[q]] - x[rods.a[q]]
        lu = np.sqrt((u * u).sum())
        lw = np.sqrt((w * w).sum())
        u /= lu
        w /= lw
        more = max(1.0 + (u * w).sum(), 0.1)
        stiff = 8.0 * rods.alpha[n] / rods.span[n] / (more * more)
        for r in range(3):
            for c in range(3):
                pu = (1.0 if r == c else 0.0) - u[r] * u[c]
                pw = (1.0 if r == c else 0.0) - w[r] * w[c]
                across = 0.0
                for m in range(3):
                    across += ((1.0 if r == m else 0.0) - u[r] * u[m]) * ((1.0 if c == m else 0.0) - w[c] * w[m])
                h[r, c] = stiff * pu / (lu * lu)
                h[3 + r, 3 + c] = stiff * pw / (lw * lw)
                h[r, 3 + c] = -stiff * across / (lu * lw)
                h[3 + c, r] = h[r, 3 + c]
        spread(h, weights, place[base + n], out)
    base += len(rods.before)
    g = np.zeros(6)
    for n in range(len(bonds.i)):
        if bonds.on[n] == 0:
            continue
        a = rods.a[bonds.j[n]]
        b = rods.b[bonds.j[n]]
        s = bonds.share[n]
        d = x[bonds.i[n]] - (1.0 - s) * x[a] - s * x[b]
        e = x[b] - x[a]
        ld = max(np.sqrt((d * d).sum()), 1e-30)
        le = max(np.sqrt((e * e).sum()), 1e-30)
        d /= ld
        e /= le
        cosine = (d * e).sum()
        for c in range(3):
            g[c] = (e[c] - cosine * d[c]) / ld
            g[3 + c] = (d[c] - cosine * e[c]) / le
        for r in range(6):
            for c in range(6):
                h[r, c] = 2.0 * bonds.s[n] * g[r] * g[c]
        for r in range(3):
            for c in range(3):
                h[r, c] += bonds.k[n] / bonds.rest[n] * d[r] * d[c]
        weights[0, 0] = 1.0
        weights[0, 1] = s - 1.0
        weights[0, 2] = -s
        weights[1, 0] = 0.0
        weights[1, 1] = -1.0
        weights[1, 2] = 1.0
        spread(h, weights, place[base + n], out)


@njit(cache=True)
def _through(
    x: np.ndarray, g: np.ndarray, begin: np.ndarray, nodes: np.ndarray, first: np.ndarray, own: np.ndarray
) -> None:
    """Overwrite x (n, 3) float32 by the solution, fronts in the order of elimination.

    g: all G one after another, that of front k (rows 3 nf, columns 3 own) from begin[k]; its nodes from first[k].
    """
    count = len(own)
    kept = np.zeros_like(x)
    for k in range(count):
        size, pivots = first[k + 1] - first[k], own[k]
        part = np.empty(3 * pivots, np.float32)
        for n in range(pivots):
            for c in range(3):
                part[3 * n + c] = x[nodes[first[k] + n], c]
        found = np.dot(g[begin[k] : begin[k + 1]].reshape(3 * size, 3 * pivots), part)
        for n in range(size):
            v = nodes[first[k] + n]
            for c in range(3):
                if n < pivots:
                    kept[v, c] = found[3 * n + c]
                else:
                    x[v, c] -= found[3 * n + c]
    for back in range(count):
        k = count - 1 - back
        size, pivots = first[k + 1] - first[k], own[k]
        part = np.empty(3 * size, np.float32)
        for n in range(size):
            v = nodes[first[k] + n]
            for c in range(3):
                part[3 * n + c] = kept[v, c] if n < pivots else -x[v, c]
        found = np.dot(g[begin[k] : begin[k + 1]].reshape(3 * size, 3 * pivots).T, part)
        for n in range(pivots):
            for c in range(3):
                x[nodes[first[k] + n], c] = found[3 * n + c]


@dataclass(frozen=True, eq=False)
class Preconditioner:
    """A factored bundle. free (v,) bool and parent of vertices are those of the moment it was factored."""

    free: np.ndarray
    g: np.ndarray
    begin: np.ndarray
    nodes: np.ndarray
    first: np.ndarray
    own: np.ndarray
    local: np.ndarray
    """(v, 3, 3) inverse of each vertex's own block, for what has split since"""

    def solve(self, r: np.ndarray, root: np.ndarray) -> np.ndarray:
        """Return the step (v, 3) for the residual r (v, 3), zero where held; root (v,): vertices when factored.

        Vertices that split since move together by the factor, and apart by their own block alone (additive Schwarz).
        """
        old = len(self.free)
        whole = r
        if len(r) > old:
            whole = r[:old].copy()
            np.add.at(whole, root[old:], r[old:])
        scale = float(np.abs(whole).max()) or 1.0
        x = (whole[self.free] / scale).astype(np.float32)
        _through(x, self.g, self.begin, self.nodes, self.first, self.own)
        out = np.zeros_like(whole)
        out[self.free] = x * scale
        if len(r) == old:
            return out
        moved: np.ndarray = out[root]
        split = np.zeros(old, bool)
        split[root[old:]] = True
        apart = np.flatnonzero(split[root])
        moved[apart] += np.einsum("vij,vj->vi", self.local[root[apart]], r[apart])
        return moved


def _flat(factor: Factor) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return g, begin, nodes, first and own of the fronts that eliminate something."""
    kept = [(f, b) for f, b in zip(factor.analysis.fronts, factor.blocks, strict=True) if f.own]
    sizes = [9 * len(f.nodes) * f.own for f, _ in kept]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    g = np.empty(int(begin[-1]), np.float32)
    for k, (front, block) in enumerate(kept):
        inverse = np.tril(lapack.dtrtri(block.pivot, lower=1)[0])
        one = g[begin[k] : begin[k + 1]].reshape(-1, 3 * front.own)
        one[: len(inverse)] = inverse
        one[len(inverse) :] = block.below @ inverse
    nodes = np.concatenate([f.nodes for f, _ in kept])
    first = np.concatenate([[0], np.cumsum([len(f.nodes) for f, _ in kept])])
    return g, begin, nodes, first, np.array([f.own for f, _ in kept])


def preconditioner(
    x: np.ndarray,
    rods: Rods,
    bonds: Bonds,
    free: np.ndarray,
    inertia: np.ndarray,
    contacts: np.ndarray | None,
    known: Stiffness | None = None,
) -> tuple[Preconditioner, Stiffness]:
    """Factor the bundle at x (v, 3) with `inertia` (v,) [N/m] and the stiffness of contacts (v, 3, 3) [N/m].

    known: the pattern, where it still holds. Returns the factor and the pattern.
    """
    pattern = known or Stiffness(rods, bonds, free)
    analysis = dissected(x[free], pattern.indptr, pattern.indices)
    for full in (True, False):
        if full:
            blocks = pattern.blocks(x, rods, bonds)
        else:
            blocks = np.zeros((len(pattern.indices), 3, 3))
            _gauss(x, rods, bonds, pattern.place, blocks)
        for c in range(3):
            blocks[pattern.diagonal, c, c] += inertia[free]
        if contacts is not None:
            blocks[pattern.diagonal] += contacts[free]
        factor = factorise(analysis, blocks)
        if all(b.signs is None for b in factor.blocks):
            break
    local = np.zeros((len(x), 3, 3))
    local[free] = np.linalg.inv(blocks[pattern.diagonal])
    return Preconditioner(free, *_flat(factor), local), pattern
