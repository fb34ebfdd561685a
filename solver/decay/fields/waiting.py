"""Spores and wounds that wait: what has landed starts to grow after its lag."""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from ...arrays import Floats

__all__ = ["Seed", "Waiting"]


class Seed(NamedTuple):
    """A colony to be: of rot or mould, at a unit direction (3) and a point (3) of the skin, of a radius [r1].

    Without a direction it is the painted map of wounds.
    """

    rots: bool
    ray: Floats | None
    place: Floats | None
    radius: float


class Waiting:
    """Seeds in the order in which they start to grow."""

    def __init__(self) -> None:
        self._queue: list[tuple[float, int, Seed]] = []
        self._count = 0

    @property
    def next(self) -> float:
        """When the next one starts [day]; infinite if none waits."""
        return self._queue[0][0] if self._queue else np.inf

    def add(self, day: float, seed: Seed) -> None:
        """Let a seed start on a day; one that never would is dropped."""
        if np.isfinite(day):
            heapq.heappush(self._queue, (day, self._count, seed))
            self._count += 1

    def pop(self) -> Seed:
        """Return the seed that starts next, which waits no longer."""
        return heapq.heappop(self._queue)[2]
