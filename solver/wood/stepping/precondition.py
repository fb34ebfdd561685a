"""A stale factor as preconditioner: the bundle as it stood when it was factored, in single precision.

Gauss and Newton's part of the stiffness is positive, so that Cholesky's factor exists whatever buckles; where the whole
stiffness is positive, too, it is the better one. The matrix is scaled to a unit diagonal first: the inertia of a slow
step is 1e-8 of what an edge resists its stretching with, as little as single precision holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...contract import NotConverged
from ...multifrontal import Analysis
from ..contact.stiffness import Contacts
from ..forces.elements import elements
from ..forces.hessian import Stiffness
from ..model.arrays import Bonds, Rods
from .dissection import dissected
from .fronts import Fronts, factored, solved

__all__ = ["Pattern", "Preconditioner", "preconditioner"]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Where the stiffness has entries, and in what order it is eliminated: as long as bonds keep their vertices."""

    stiffness: Stiffness
    analysis: Analysis
    row: np.ndarray
    """(nnz,) row of each block"""

    @staticmethod
    def of(x: np.ndarray, rods: Rods, bonds: Bonds, free: np.ndarray, couples: np.ndarray) -> Pattern:
        """Return the pattern of the free vertices and `couples` (m, 2), dissected where they are at x (v, 3)."""
        stiffness = Stiffness(rods, bonds, free, couples)
        row = np.repeat(np.arange(stiffness.size), np.diff(stiffness.indptr))
        return Pattern(stiffness, dissected(x[free], stiffness.indptr, stiffness.indices), row)


@dataclass(frozen=True, eq=False)
class Preconditioner:
    """A factored bundle. free (v,) bool and parent of vertices are those of the moment it was factored."""

    free: np.ndarray
    fronts: Fronts
    scale: np.ndarray
    """(free, 3) roots of the diagonal's inverse [sqrt(m/N)]"""
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
        right = whole[self.free] * self.scale
        size = float(np.abs(right).max()) or 1.0
        x = (right / size).astype(np.float32)
        solved(x, self.fronts)
        out = np.zeros_like(whole)
        out[self.free] = x * self.scale * size
        if len(r) == old:
            return out
        moved: np.ndarray = out[root]
        split = np.zeros(old, bool)
        split[root[old:]] = True
        apart = np.flatnonzero(split[root])
        moved[apart] += np.einsum("vij,vj->vi", self.local[root[apart]], r[apart])
        return moved


def preconditioner(
    x: np.ndarray,
    rods: Rods,
    bonds: Bonds,
    free: np.ndarray,
    inertia: np.ndarray,
    contacts: Contacts,
    known: Pattern | None = None,
    double: bool = False,
) -> tuple[Preconditioner, Pattern]:
    """Factor the bundle at x (v, 3) with `inertia` (v,) [N/m] and the stiffness of contacts.

    known: the pattern, where it still holds. double: factor in double precision. Returns the factor and the pattern.

    Raises:
        NotConverged: not even the positive part has a factor.

    """
    pattern = known or Pattern.of(x, rods, bonds, free, contacts.couples())
    stiffness = pattern.stiffness
    for positive, exact in ((False, double), (True, double), (True, True)):
        blocks = stiffness.summed(elements(x, rods, bonds, positive=positive))
        for c in range(3):
            blocks[stiffness.diagonal, c, c] += inertia[free]
        contacts.spread(stiffness, blocks)
        diagonal = blocks[stiffness.diagonal]
        own = np.einsum("vii->vi", diagonal)
        if (own <= 0).any():
            continue
        scale = 1 / np.sqrt(own)
        blocks *= scale[pattern.row][:, :, None] * scale[stiffness.indices][:, None, :]
        fronts = factored(pattern.analysis, blocks, exact)
        if fronts is not None:
            break
    else:
        raise NotConverged("the stiffness is not finite.", advice="Give a shorter step.")
    local = np.zeros((len(x), 3, 3))
    local[free] = np.linalg.inv(diagonal)
    return Preconditioner(free, fronts, scale, local), pattern
