"""An approximate inverse of a shell's tangent: motions along the normals and within the surface apart.

Of the tangent K two matrices with one number per pair of vertices are kept: n_i . K_ij n_j for normal motions, and half
the trace of P_i K_ij P_j, P = 1 - n n^T, for those within the surface, which treats both of their directions alike.
Both are positive semidefinite if K is. Against a factor of K that is a ninth of the numbers and a twenty-seventh of
the work; as the start of L-BFGS it takes about half as many iterations more (docs/growth.md).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints, Singles
from ..linalg.abreast import abreast
from ..linalg.cholesky import factor
from ..linalg.dissection import Fronts, dissect
from ..linalg.substitution import substitute
from .pattern import Pattern
from .topology import Topology

__all__ = ["Inverse", "fronts_of", "inverse_of"]


#: Hinges in the smallest front.
_LEAF = 80
#: Entries beyond are those of triangles without area [mu].
_MOST = 1e12
#: What a new vertex gives alone under a force: about the inverse of a membrane's diagonal [1 / mu].
_SOFT = 0.2


def fronts_of(mesh: Topology, x: Floats) -> Fronts:
    """Return the order of elimination for meshes that lie about where x (n, 3) does."""
    t = mesh.triangles
    # a triangle without neighbours is in no hinge, a vertex without triangles in neither
    lone, bare = _unnamed(mesh.hinge_faces, len(t)), _unnamed(t, mesh.vertices)
    parts = np.concatenate([mesh.hinges, t[lone][:, [0, 1, 2, 2]], np.repeat(bare[:, None], 4, axis=1)])
    return dissect(parts, x[parts].mean(axis=1), mesh.vertices, _LEAF)


def _unnamed(numbers: Ints, count: int) -> Ints:
    """Return which numbers below count are not among some, rising."""
    there = np.zeros(count, np.bool_)
    there[numbers] = True
    return np.flatnonzero(~there)


@dataclass(frozen=True, eq=False)
class Inverse:
    """Factors L L^T of both matrices; across: normal, within: tangential motions. normals: (n, 3).

    parents: after remeshing, for each change the pair (n', 2) of old vertices in the middle of which each new one lies
    (twice the same for one that stayed): the inverse then acts on what the old vertices can do.
    """

    fronts: Fronts
    normals: Floats
    across: Singles
    within: Singles
    parents: tuple[Ints, ...] = ()

    def apply(self, right: Floats) -> Floats:
        """Return the approximate inverse applied to `right` (n, 3)."""
        rights = [right]
        counts = [len(self.normals), *(len(pairs) for pairs in self.parents)]
        for pairs, count in zip(reversed(self.parents), reversed(counts[:-1]), strict=True):
            rights.append(_gathered(rights[-1], pairs, count))
        found = np.empty((counts[0], 3))
        substitute(rights[-1], self.normals, self.fronts, self.across, self.within, found)
        for pairs, own in zip(self.parents, reversed(rights[:-1]), strict=True):
            found = 0.5 * (found[pairs[:, 0]] + found[pairs[:, 1]])
            new = pairs[:, 0] != pairs[:, 1]
            found[new] += _SOFT * own[new]
        return found

    def remeshed(self, pairs: Ints) -> Inverse:
        """Return the inverse for a mesh whose vertices lie in the middle of `pairs` (n', 2) of the present ones."""
        return replace(self, parents=(*self.parents, pairs))


def inverse_of(
    fronts: Fronts, pattern: Pattern, blocks: Floats, n: Floats, held: Bools
) -> Generator[None, None, Inverse]:
    """Factor the tangent with `blocks` (nnz, 3, 3), n: normals (n, 3); yields after pieces of bounded work.

    held: (n,) vertices that do not move. The generator's value is the Inverse. Raises numpy.linalg.LinAlgError if a
    matrix is not finite.
    """
    across, within = np.empty(pattern.blocks), np.empty(pattern.blocks)
    _reduce(blocks, n, pattern.indptr, pattern.indices, held, across, within)
    yield
    first, second = yield from abreast(
        factor(fronts, pattern.indptr, pattern.indices, across),
        factor(fronts, pattern.indptr, pattern.indices, within),
    )
    return Inverse(fronts, n, first, second)


def _gathered(right: Floats, pairs: Ints, count: int) -> Floats:
    """Return what the old vertices (count, 3) feel of forces on the new ones: half of those of their children."""
    both = [np.bincount(pairs.ravel(), np.repeat(0.5 * right[:, d], 2), count) for d in range(3)]
    return np.stack(both, -1)


@njit(cache=True)
def _reduce(
    blocks: Floats, n: Floats, indptr: Ints, indices: Ints, held: Bools, across: Floats, within: Floats
) -> None:
    """Write n_i K n_j and the trace of P_i K P_j / 2 of each block."""
    for i in range(len(n)):
        for at in range(indptr[i], indptr[i + 1]):
            j = indices[at]
            if held[i] or held[j]:
                across[at] = within[at] = 1.0 if i == j else 0.0
                continue
            k = blocks[at]
            trace, both, left, right, cosine = k[0, 0] + k[1, 1] + k[2, 2], 0.0, 0.0, 0.0, 0.0
            for d in range(3):
                cosine += n[i, d] * n[j, d]
                for h in range(3):
                    both += n[i, d] * k[d, h] * n[j, h]
                    left += n[i, d] * k[d, h] * n[i, h]
                    right += n[j, d] * k[d, h] * n[j, h]
            within[at] = 0.5 * (trace - left - right + cosine * both)
            across[at] = both
            # triangles without area bend without bound: they are left to themselves
            if not (abs(across[at]) < _MOST and abs(within[at]) < _MOST):
                across[at] = within[at] = _MOST if i == j else 0.0
