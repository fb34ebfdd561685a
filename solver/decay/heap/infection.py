"""Rot that goes from one fruit to the other where they touch.

Each side of a contact has a clock: how much rot it has seen on the other side, in days at the best temperature, against
a limit drawn once from the seed. Who is rotten there already catches nothing.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Bools, Floats
from ..params import DecayParams
from .lying import separate

__all__ = ["Exposure"]

#: Map value from which a contact is rotten, and below which it is sound.
ROTTEN, SOUND = 0.1, 0.05


class Exposure:
    """How long each fruit has lain against rot of each other one (b, b), and how long it stands it (b, b) [day]."""

    def __init__(self, params: DecayParams) -> None:
        heap = params.heap
        assert heap is not None
        limits = separate(params, 1).exponential(1.0, (heap.count, heap.count))
        self._limit: Floats = limits / heap.infection if heap.infection > 0 else np.full_like(limits, np.inf)
        self._seen: Floats = np.zeros_like(limits)
        self._caught: Bools = np.zeros(limits.shape, np.bool_)

    def sees(self, here: int, there: int, mine: float, theirs: float, days: float) -> bool:
        """Return whether a fruit catches now what is on the other side of a contact.

        mine, theirs: rot on both sides, 0 to 1. days: how long since the last look, at the best temperature.
        """
        if self._caught[here, there] or theirs < ROTTEN or mine >= SOUND:
            return False
        self._seen[here, there] += days
        self._caught[here, there] = self._seen[here, there] >= self._limit[here, there]
        return bool(self._caught[here, there])
