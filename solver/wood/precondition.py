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
from .contact import Contacts
from .dissection import dissected
from .elements import elements
from .hessian import Stiffness

__all__ = ["Preconditioner", "preconditioner"]


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
    contacts: Contacts,
    known: Stiffness | None = None,
) -> tuple[Preconditioner, Stiffness]:
    """Factor the bundle at x (v, 3) with `inertia` (v,) [N/m] and the stiffness of contacts.

    known: the pattern, where it still holds. Returns the factor and the pattern.
    """
    pattern = known or Stiffness(rods, bonds, free, contacts.couples())
    analysis = dissected(x[free], pattern.indptr, pattern.indices)
    for full in (True, False):
        blocks = pattern.summed(elements(x, rods, bonds, positive=not full))
        for c in range(3):
            blocks[pattern.diagonal, c, c] += inertia[free]
        contacts.spread(pattern, blocks)
        factor = factorise(analysis, blocks)
        if all(b.signs is None for b in factor.blocks):
            break
    local = np.zeros((len(x), 3, 3))
    local[free] = np.linalg.inv(blocks[pattern.diagonal])
    return Preconditioner(free, *_flat(factor), local), pattern
