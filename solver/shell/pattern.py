"""Where the blocks of triangles and hinges go in one sparse matrix of 3x3 blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Ints
from ..linalg.patterns import of_pairs, places
from .topology import Topology

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

    def of(self, cliques: Ints) -> Ints:
        """Return where the blocks of vertices (m, c) that are coupled with each other are, (m, c c)."""
        found = places(np.ascontiguousarray(cliques), self.indptr, self.indices)
        return found.reshape(len(cliques), cliques.shape[1] ** 2)


def pattern(mesh: Topology, more: Ints | None = None) -> Pattern:
    """Return the pattern of a mesh's tangent, and of `more` coupled vertices (m, 2).

    Vertices of no triangle have their diagonal block.
    """
    n = mesh.vertices
    # corners share a triangle where there is an edge; those of a hinge else are the opposite ones
    both = np.concatenate([mesh.edges, mesh.hinges[:, 2:], *([] if more is None else [more])])
    indptr, indices, diagonal = of_pairs(both, n)
    return Pattern(
        indptr=indptr,
        indices=indices,
        of_triangles=places(mesh.triangles, indptr, indices).reshape(-1, 9),
        of_hinges=places(mesh.hinges, indptr, indices).reshape(-1, 16),
        diagonal=diagonal,
    )
