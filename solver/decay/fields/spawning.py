"""New colonies as events in continuous time, from a seeded generator: rates, not chances per frame (D22, D23).

Every colony has a clock of its own (a Poisson process); spores that land anywhere have one more. Which events there
are, and when, depends on the seed and on what grew, never on the stages that were asked for.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from ...arrays import Floats

__all__ = ["Landing", "Spawner"]


#: Colonies of a kind on one fruit: by then they have run into one another, and no more clocks are started.
_MOST = 200


class Landing(NamedTuple):
    """When [day] and at which unit direction (3) a spore comes down; a mark in [0, 1) to weigh against a chance."""

    day: float
    direction: Floats
    mark: float
    stray: bool


class Spawner:
    """The clocks of one kind of colony. per_colony and strays: events per day; reach: farthest landing [radian]."""

    def __init__(self, per_colony: float, strays: float, reach: float, generator: np.random.Generator) -> None:
        self._per_colony, self._strays, self._reach = per_colony, strays, reach
        self._generator = generator
        self._parents: list[Floats] = []
        self._clocks: list[tuple[float, int]] = []
        if strays > 0:
            self._wind(0.0, -1)

    @property
    def next(self) -> float:
        """When the next spore lands [day]; infinite if none ever does."""
        return self._clocks[0][0] if self._clocks else np.inf

    def settle(self, direction: Floats, day: float) -> None:
        """Start the clock of a new colony at a unit direction (3)."""
        self._parents.append(direction)
        if self._per_colony > 0 and len(self._parents) <= _MOST:
            self._wind(day, len(self._parents) - 1)

    def land(self) -> Landing:
        """Return the next landing, and wind its clock again."""
        day, parent = heapq.heappop(self._clocks)
        self._wind(day, parent)
        draw = self._generator
        free = draw.normal(size=3)
        mark, distance = draw.uniform(size=2)
        if parent < 0:
            return Landing(day, free / np.linalg.norm(free), float(mark), True)
        home = self._parents[parent]
        aside = free - (free @ home) * home
        aside /= np.linalg.norm(aside)
        # even over the cap: the area within an angle grows as 1 - cos
        cosine = 1 - distance * (1 - np.cos(self._reach))
        return Landing(day, cosine * home + np.sqrt(1 - cosine**2) * aside, float(mark), False)

    def _wind(self, day: float, parent: int) -> None:
        rate = self._strays if parent < 0 else self._per_colony
        heapq.heappush(self._clocks, (day + self._generator.exponential(1 / rate), parent))
