"""A Cholesky factor of a shell's tangent that is solved many times: fronts packed end to end, compiled sweeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..multifrontal import Analysis, analyse, factorise
from .pattern import Pattern
from .topology import Topology

__all__ = ["Packed", "dissect", "factor"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Hinges in the smallest front: fewer make more fronts than the interpreter likes, more make them fuller.
_LEAF = 24


def dissect(mesh: Topology, pattern: Pattern, x: Floats) -> Analysis:
    """Return the order of elimination for meshes that lie about where x (n, 3) does."""
    t = mesh.triangles
    # a triangle without neighbours is in no hinge, a vertex without triangles in neither
    lone = np.setdiff1d(np.arange(len(t)), mesh.hinge_faces)
    bare = np.setdiff1d(np.arange(mesh.vertices), t)
    parts = np.concatenate([mesh.hinges, t[lone][:, [0, 1, 2, 2]], np.repeat(bare[:, None], 4, axis=1)])
    return analyse(parts, x[parts].mean(axis=1), 1, pattern.indptr, pattern.indices, _LEAF)


@dataclass(frozen=True, eq=False)
class Packed:
    """Factor L L^T. nodes, values: fronts end to end; starts: (fronts + 1, 2) into both; own: eliminated in each."""

    nodes: Ints
    values: Floats
    starts: Ints
    own: Ints

    def solve(self, right: Floats) -> Floats:
        """Return x of A x = right, both (n, 3)."""
        x = right.copy()
        _sweep(x, self.nodes, self.values, self.starts, self.own)
        return x


def factor(analysis: Analysis, blocks: Floats) -> Packed:
    """Return the factor of a positive definite matrix with `blocks` (nnz, 3, 3).

    Raises numpy.linalg.LinAlgError if it is not positive definite.
    """
    found = factorise(analysis, blocks)
    if any(block.signs is not None for block in found.blocks):
        raise np.linalg.LinAlgError("the tangent is not positive definite")
    pieces = [
        np.vstack([block.pivot, block.below]).ravel(order="F") if front.own else np.zeros(0)
        for front, block in zip(analysis.fronts, found.blocks, strict=True)
    ]
    sizes = [[len(front.nodes), len(piece)] for front, piece in zip(analysis.fronts, pieces, strict=True)]
    return Packed(
        nodes=np.concatenate([front.nodes for front in analysis.fronts]),
        values=np.concatenate(pieces),
        starts=np.concatenate([[[0, 0]], np.cumsum(sizes, axis=0)]),
        own=np.array([front.own for front in analysis.fronts]),
    )


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _sweep(x: Floats, nodes: Ints, values: Floats, starts: Ints, own: Ints) -> None:
    """Solve L L^T in place of x (n, 3)."""
    widest = 0
    for f in range(len(own)):
        widest = max(widest, starts[f + 1, 0] - starts[f, 0])
    part = np.empty(3 * widest)
    for f in range(len(own)):
        first, size, pivots = starts[f, 0], 3 * (starts[f + 1, 0] - starts[f, 0]), 3 * own[f]
        for r in range(size):
            part[r] = x[nodes[first + r // 3], r % 3] if r < pivots else 0.0
        for c in range(pivots):
            column = values[starts[f, 1] + c * size : starts[f, 1] + (c + 1) * size]
            part[c] /= column[c]
            for r in range(c + 1, size):
                part[r] -= column[r] * part[c]
        for r in range(size):
            if r < pivots:
                x[nodes[first + r // 3], r % 3] = part[r]
            else:
                x[nodes[first + r // 3], r % 3] += part[r]
    for f in range(len(own) - 1, -1, -1):
        first, size, pivots = starts[f, 0], 3 * (starts[f + 1, 0] - starts[f, 0]), 3 * own[f]
        for r in range(size):
            part[r] = x[nodes[first + r // 3], r % 3]
        for c in range(pivots - 1, -1, -1):
            column = values[starts[f, 1] + c * size : starts[f, 1] + (c + 1) * size]
            total = part[c]
            for r in range(c + 1, size):
                total -= column[r] * part[r]
            part[c] = total / column[c]
        for r in range(pivots):
            x[nodes[first + r // 3], r % 3] = part[r]
