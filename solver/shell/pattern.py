"""Where the blocks of triangles and hinges go in one sparse matrix of 3x3 blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .topology import Topology

__all__ = ["Pattern", "pattern"]

Ints = NDArray[np.int64]


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

    def pairs(corners: Ints) -> Ints:
        return (corners[:, :, None] * n + corners[:, None, :]).reshape(len(corners), -1)

    triangles, hinges, own = pairs(mesh.triangles), pairs(mesh.hinges), np.arange(n) * (n + 1)
    keys, inverse = np.unique(np.concatenate([triangles.ravel(), hinges.ravel(), own]), return_inverse=True)
    inverse = inverse.ravel()
    a, b = triangles.size, triangles.size + hinges.size
    return Pattern(
        indptr=np.searchsorted(keys // n, np.arange(n + 1)),
        indices=keys % n,
        of_triangles=inverse[:a].reshape(triangles.shape),
        of_hinges=inverse[a:b].reshape(hinges.shape),
        diagonal=inverse[b:],
    )
