"""The samples near a query and their weights: inverse distance in parameters scaled to 0..1 (Eq. 14 of the paper)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.arrays import Array

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

__all__ = ["SAME", "Neighbours", "Weighted"]


#: Scaled distance below which a query is the sample itself: round-off of parameters that went through text.
SAME = 1e-9
#: Samples that are all looked at faster than a tree is walked.
_FEW = 500


class Weighted(NamedTuple):
    """Indices of samples, their weights (which sum to 1), and the scaled distance of the nearest."""

    samples: Array
    weights: Array
    nearest: float


class Neighbours:
    """A tree over samples (count, axes)."""

    def __init__(self, values: Array) -> None:
        self._low = values.min(axis=0)
        self._span = values.max(axis=0) - self._low
        self._count = len(values)
        self._scaled = (values - self._low) / self._span

    def distance(self, query: Array) -> float:
        """Return the scaled distance to the nearest sample; 0 where it is hit."""
        scaled = (query - self._low) / self._span
        if self._count > _FEW:
            found = float(self._nearest(scaled, 1)[0][0])
        else:
            offsets = self._scaled - scaled
            found = math.sqrt(float(np.einsum("ij,ij->i", offsets, offsets).min()))
        return found if found >= SAME else 0.0

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree  # takes half of a service's start to import, and few tables need it

        return cKDTree(self._scaled)

    def _nearest(self, scaled: Array, count: int) -> tuple[Array, Array]:
        """Return the distances (count,) and numbers (count,) of the nearest samples, the nearest first."""
        if self._count > _FEW:
            found = self._tree.query(scaled, k=np.arange(1, count + 1))
            return np.asarray(found[0]), np.asarray(found[1])
        offsets = self._scaled - scaled
        squares = np.einsum("ij,ij->i", offsets, offsets)
        order = squares.argsort(kind="stable")[:count] if count > 1 else squares.argmin(keepdims=True)
        return np.sqrt(squares[order]), order

    def weigh(self, query: Array, m: int, eta: float) -> Weighted:
        """Weigh the `m` nearest samples by distance^-eta; a sample that is hit takes all."""
        scaled = (query - self._low) / self._span
        distance, samples = self._nearest(scaled, min(m, self._count))
        nearest = float(distance[0])
        if nearest < SAME:
            return Weighted(samples[:1], np.ones(1), 0.0)
        weights = (nearest / distance) ** eta  # scaled by the nearest: no overflow however close it is
        return Weighted(samples, weights / weights.sum(), nearest)

    def fade(self, query: Array, m: int, eta: float) -> Weighted:
        """Weigh the `m` nearest samples by ((R - d) / (R d))^eta, R the distance of the next one.

        Franke and Nielson (1980): like inverse distance close to a sample, but a sample that leaves the set of the
        nearest has no weight left when it does. Where all samples take part, this is inverse distance.
        """
        if m >= self._count:
            return self.weigh(query, m, eta)
        distance, samples = self._nearest((query - self._low) / self._span, m + 1)
        nearest, reach = float(distance[0]), float(distance[-1])
        if nearest < SAME:
            return Weighted(samples[:1], np.ones(1), 0.0)
        parts = nearest / distance[:-1] * np.maximum(1 - distance[:-1] / reach, 1e-12)
        weights = (parts / parts.max()) ** eta  # where all are as far as the next one, powers would vanish
        return Weighted(samples[:-1], weights / weights.sum(), nearest)

    def without(self, i: int, m: int) -> Weighted:
        """Weigh the `m` nearest others of sample `i` by distance^-2."""
        distance = np.linalg.norm(self._scaled - self._scaled[i], axis=1)
        others = np.argsort(distance, kind="stable")
        others = others[others != i][:m]
        weights = distance[others] ** -2.0
        return Weighted(others, weights / weights.sum(), float(distance[others[0]]))

    @property
    def spacing(self) -> Array:
        """Scaled distance (count,) from each sample to the nearest other one; infinite where there is none."""
        if self._count == 1:
            return np.full(1, np.inf)
        if self._count <= _FEW:
            return np.array([self._nearest(scaled, 2)[0][1] for scaled in self._scaled])
        return np.asarray(self._tree.query(self._scaled, k=[2])[0])[:, 0]

    def pairs(self) -> list[tuple[int, int]]:
        """Return each sample with the one nearest to it."""
        if self._count == 1:
            return []
        nearest = np.asarray(self._tree.query(self._scaled, k=[2])[1])[:, 0]
        return [(i, int(j)) for i, j in enumerate(nearest)]
