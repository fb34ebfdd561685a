"""What arrives on a fruit: spores of its colonies, strays, wounds and neighbours' rot, each to start after its lag."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Floats
from ..climate import Germination
from ..params import DecayParams
from .spawning import Landing, Spawner
from .waiting import Seed, Waiting

__all__ = ["Arrivals"]


class Arrivals:
    """The clocks of rot's and mould's colonies, and the seeds that have landed and wait.

    generators: of the rot's clocks and of the mould's. strays: whether spores land that no colony here sent.
    """

    def __init__(self, params: DecayParams, strays: bool, generators: list[np.random.Generator]) -> None:
        chance = params.spawning / (10 - params.propagation_rate)
        anywhere = params.rot_spawning if strays else 0.0
        self.rot = Spawner(chance, 0.0, params.spawn_reach, generators[0])
        self.mould = Spawner(chance, anywhere, params.spawn_reach, generators[1])
        self._waiting = Waiting()
        self._due: tuple[float, Seed] | None = None
        self.live_on(params)

    def live_on(self, params: DecayParams) -> None:
        """Let what lands from now on have the lags of these parameters; in the paper's climate nothing has one."""
        self._cardinal = params.climate == "cardinal"
        self._waits = {True: Germination(params.rot, params), False: Germination(params.mould, params)}

    def settle(self, rots: bool, direction: Floats, day: float) -> None:
        """Start the clock of a colony that begins to grow at a unit direction (3) on a day."""
        (self.rot if rots else self.mould).settle(direction, day)

    def land(self, day: float, seed: Seed) -> None:
        """Let a seed land on a day, to start when its lag is over."""
        self._waiting.add(self._waits[seed.rots].day(day) if self._cardinal else day, seed)

    def again(self) -> None:
        """Forget which seed is the next one: another has come that may start before it."""
        if self._due is not None:
            self._waiting.add(*self._due)
            self._due = None

    def next(self, until: float, rooted: Callable[[Landing, bool], Seed | None]) -> float:
        """Return when the next seed starts to grow [day], infinite if none does before `until`.

        rooted: the seed that a landing of rot (True) or mould leaves, None where it does not take root.
        """
        while self._due is None:
            first = self.rot if self.rot.next <= self.mould.next else self.mould
            if min(first.next, self._waiting.next) > until:
                return np.inf
            if self._waiting.next <= first.next:
                self._due = self._waiting.next, self._waiting.pop()
                break
            landing = first.land()
            seed = rooted(landing, first is self.rot)
            if seed is not None:
                self.land(landing.day, seed)
        return self._due[0]

    def pop(self) -> tuple[float, Seed]:
        """Return the seed that is due, and its day."""
        assert self._due is not None
        due, self._due = self._due, None
        return due
