"""The step of a run, which is chosen anew as wood breaks, and the time that has come with it."""

from __future__ import annotations

import numpy as np

from ..contact.listing import law
from ..model.state import State
from ..params import WoodParams
from .stability import FEW, longest_step

__all__ = ["Pace"]

#: Steps per evaluation of forces that a new step is worth, and how many are granted at the start.
_RARELY, _AT_ONCE = 20, 1000
#: The shortest step over the first.
_LEAST = 0.25


class Pace:
    """The step, and the time that has come with it."""

    def __init__(self, state: State, params: WoodParams, dt: float, courant: float) -> None:
        """Begin at time 0 with a step of dt [s]; courant: the most that it may be of the longest stable one."""
        self.dt, self._first, self._courant, self._asked = dt, dt, courant, 0
        self._time, self._from, self._plan = 0.0, 0, state.scratch.plan
        self._contact = float(law(state.wood, params)[1]) if params.touching else 0.0

    def at(self, steps: int) -> float:
        """Return the time [s] after so many steps."""
        return self._time + (steps - self._from) * self.dt

    def within(self, time: float) -> int:
        """Return after how many steps `time` [s] is reached, or would be with the next one."""
        return self._from + int(np.floor((time - self._time) / self.dt * (1 + 1e-12)))

    def fit(self, state: State) -> None:
        """Choose the step anew, no longer than the first one, where what broke is stiffer or lighter than it bears.

        A vertex that splits has two halves of its mass, and bonds beside a new end hold on to a curve that goes on
        straight. The step may be two thirds then of what it was. It is asked for as often as costs a twentieth of the
        run.
        """
        if self._plan is state.scratch.plan or self._asked * FEW * 2 * _RARELY > state.steps + _AT_ONCE:
            return
        self._plan, self._asked = state.scratch.plan, self._asked + 1
        longest = self._courant * longest_step(state.wood, self._contact, FEW)
        # what is folded flat is stiffer than anything for a moment
        dt = min(max(longest, _LEAST * self._first), self._first)
        if dt != self.dt:
            self._time, self._from, self.dt = self.at(state.steps), state.steps, dt
