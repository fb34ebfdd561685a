"""What the second derivatives of one topology share: pattern, order of elimination, last inverse."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ...linalg.dissection import Fronts
from ...linalg.multifrontal import Analysis, analyse
from ...shell.inverse import Inverse

__all__ = ["LEAF", "Tangent"]

#: An inverse outlives so many remeshings, and so many times its vertices.
_LAYERS, _MORE = 12, 1.3
#: Pairs of vertices in the smallest front: below some twenty, calls take longer than their arithmetic.
LEAF = 24


class Tangent:
    """Pattern, order of elimination and last inverse of one topology; outlives the growth steps between remeshings."""

    def __init__(self, mesh: shell.Topology, inverse: Inverse | None = None) -> None:
        self.mesh = mesh
        self.fronts: Fronts | None = None
        self.inverse = inverse
        self._analysis: Analysis | None = None

    @cached_property
    def pattern(self) -> shell.Pattern:
        """Where blocks go."""
        return shell.pattern(self.mesh)

    def analysis(self, x: Floats) -> Analysis:
        """Return the order in which the whole second derivative is eliminated; x (n, 3) of the first call decides."""
        if self._analysis is None:
            pairs = np.concatenate([self.mesh.edges, self.mesh.hinges[:, 2:]])
            indptr, indices = self.pattern.indptr, self.pattern.indices
            self._analysis = analyse(pairs, x[pairs].mean(axis=1), indptr, indices, leaf_size=LEAF)
        return self._analysis

    def copy(self) -> Tangent:
        """Return a tangent that starts from this one's inverse, and may take another."""
        found = Tangent(self.mesh, self.inverse)
        found.fronts = self.fronts
        if "pattern" in self.__dict__:
            found.__dict__["pattern"] = self.pattern
        return found

    def remeshed(self, mesh: shell.Topology, pairs: Ints) -> Tangent:
        """Return the tangent of a mesh whose vertices lie in the middle of `pairs` (n', 2) of this one's."""
        kept = self.inverse
        if kept is not None and (len(kept.parents) >= _LAYERS or len(pairs) > _MORE * len(kept.normals)):
            kept = None
        return Tangent(mesh, kept.remeshed(pairs) if kept else None)
