"""Where the blocks of triangles and hinges go in one sparse matrix of 3x3 blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ..arrays import Ints
from .topology import Topology, distinct

__all__ = ["Pattern", "pattern"]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Block CSR over vertices, both triangles. of_triangles: (f, 9), of_hinges: (h, 16), diagonal: (n,) blocks."""

    indptr: Ints
    indices: Ints
    of_triangles: Ints
    of_hinges: Ints
    diagonal: Ints

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.indices)


def pattern(mesh: Topology) -> Pattern:
    """Return the pattern of a mesh's tangent; vertices of no triangle have their diagonal block."""
    n = mesh.vertices
    # corners share a triangle where there is an edge; those of a hinge else are the opposite ones
    both = np.concatenate([mesh.edges, mesh.hinges[:, 2:]])
    keys = distinct(np.concatenate([both @ [n, 1], both @ [1, n], np.arange(n) * (n + 1)]))
    indptr, indices = np.searchsorted(keys // n, np.arange(n + 1)), keys % n
    own = np.arange(n)[:, None]
    return Pattern(
        indptr=indptr,
        indices=indices,
        of_triangles=_places(mesh.triangles, indptr, indices),
        of_hinges=_places(mesh.hinges, indptr, indices),
        diagonal=_places(own, indptr, indices)[:, 0],
    )


@njit(cache=True)
def _places(corners: Ints, indptr: Ints, indices: Ints) -> Ints:
    """Return where the blocks of all pairs of corners (m, c) lie (m, c^2); -1 of pairs that have none."""
    width = corners.shape[1]
    found = np.full((len(corners), width * width), -1)
    for t in range(len(corners)):
        for a in range(width):
            i = corners[t, a]
            for b in range(width):
                for at in range(indptr[i], indptr[i + 1]):
                    if indices[at] == corners[t, b]:
                        found[t, width * a + b] = at
                        break
    return found
