"""The march along shrinkage: from a smooth start, past the onset, to stages that are settled on the side.

The march depends on the parameters and the quality alone. A stage is settled on a copy of the marching state, so what
else was asked for never changes a stage's shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Singles
from ..contract import Context
from .fresh.mesh import FruitMesh
from .kernel import new_state
from .motion import Motion
from .params import DehydrationParams
from .settings import Settings
from .settle import State, settle

__all__ = ["Path", "State"]

Fixed = NDArray[np.int32]

#: Shrinkage after which the scaled masses are taken anew.
_REWEIGH = 0.01

#: Updates of the rest volumes before a stage settles, and calm steps between two: what rings is gone by the next.
_PRESSINGS, _PRESSING_STEPS = 6, 150


class Path:
    """One fruit's way from fresh to dry."""

    def __init__(
        self, params: DehydrationParams, settings: Settings, context: Context, *, with_release: bool = False
    ) -> None:
        self._with_release = with_release
        self._settings, self._context = settings, context
        self.motion = Motion(params, settings, context)
        self._rest = self.motion.rest
        self._state, self._velocity = new_state(self.motion.layout)
        self._place = 0
        self._begun = False

    @property
    def mesh(self) -> FruitMesh:
        """The whole fruit's mesh."""
        return self.motion.mesh

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return self.motion.elements

    def stage(self, shrinkage: float, last: float) -> State:
        """Return the settled state at `shrinkage`; stages are asked for in ascending order, up to `last`.

        Raises:
            Cancelled: the observer asked to stop.
            Unstable: the state left the finite, or elements turned inside out.

        """
        settings = self._settings
        if shrinkage <= settings.start:
            return self._settle(*self._pressed(*self.motion.smooth(shrinkage), self._rest, shrinkage), shrinkage)
        target = int((shrinkage - settings.start) / settings.pace)
        self._march(target, last)
        state, velocity, rest = self._state.copy(), self._velocity.copy(), self._rest
        if target > self._place:
            a, b = self._at(self._place), self._at(target)
            # what is left to a stage is done on its copy
            rest = self.motion.advance(state, velocity, rest, target - self._place, a, b, settings.damping)
        return self._settle(*self._pressed(state, velocity, rest, shrinkage), shrinkage)

    def _at(self, place: int) -> float:
        """Return the shrinkage after `place` steps of the march."""
        return self._settings.start + place * self._settings.pace

    def _pressed(
        self, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float
    ) -> tuple[Fixed, Singles, Floats]:
        """Let rest volumes catch up with the pressure: a march's lag by 0.03 of shrinkage, a smooth start's know none.

        Returns state, velocity (both changed in place) and rest volumes.
        """
        for _ in range(_PRESSINGS):
            rest = self.motion.advance(
                state, velocity, rest, _PRESSING_STEPS, shrinkage, shrinkage, self._settings.calm_damping
            )
        return state, velocity, rest

    def _march(self, target: int, last: float) -> None:
        """March in whole slices to at most `target` steps, whatever stages were asked for."""
        settings = self._settings
        if not self._begun:
            self._state, self._velocity = self.motion.smooth(settings.start)
            self._begun = True
        chunk = max(20, min(self.motion.slice, round(_REWEIGH / settings.pace)))
        every = max(1, round(_REWEIGH / (chunk * settings.pace)))
        while self._place + chunk <= target:
            if self._place // chunk % every == 0:
                self.motion.layout = self.motion.weighed(self._state)
            a, b = self._at(self._place), self._at(self._place + chunk)
            self._rest = self.motion.advance(self._state, self._velocity, self._rest, chunk, a, b, settings.damping)
            self._place += chunk
            self._context.report(b / last if last else 1.0, f"shrinkage s = {b:.3f}")

    def _settle(self, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float) -> State:
        return settle(self.motion, state, velocity, rest, shrinkage, self._with_release)
