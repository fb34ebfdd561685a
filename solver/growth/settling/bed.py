"""The springs of an elastic bed under a sheet, as its energy sees them."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...arrays import Floats, Ints
from ..state import State

__all__ = ["Bed"]


class Bed:
    """Springs between vertices and the tangent planes of the start shape where they come from."""

    def __init__(self, stiff: Floats, places: Floats, normals: Floats) -> None:
        """stiff: (n,) force per depth [mu]. places, normals: (n, 3)."""
        self.stiff, self._places = stiff, places
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)

    @classmethod
    def under(cls, state: State, areas: Floats) -> Self | None:
        """Return the bed of a state, whose vertices have rest areas (n,); None where it has none."""
        if "bed" not in state.matter:
            return None
        rows = state.matter["bed"]
        return cls(rows[:, 0] * areas, rows[:, 1:4], rows[:, 4:7])

    def energy(self, x: Floats, gradient: Floats) -> float:
        """Return the energy at x (n, 3) and add its gradient."""
        depth = ((x - self._places) * self.normals).sum(axis=1)
        force = self.stiff * depth
        gradient += force[:, None] * self.normals
        return 0.5 * float(force @ depth)

    def add_hessian(self, diagonal: Ints, blocks: Floats) -> None:
        """Add the second derivative to the diagonal of `blocks` (nnz, 3, 3)."""
        blocks[diagonal] += (self.stiff[:, None] * self.normals)[:, :, None] * self.normals[:, None, :]

    def felt(self, motions: Floats) -> Floats:
        """Return how motions (3n, k) go against the springs (n, k), by the root of their share of the stiffest."""
        n = len(self.stiff)
        along = np.einsum("nc,nck->nk", self.normals, motions.reshape(n, 3, -1))
        found: Floats = np.sqrt(self.stiff / max(float(self.stiff.max()), 1e-300))[:, None] * along
        return found
