"""The way along shrinkage: from a smooth start, past the onset, up a ladder of settled states.

Rungs (`Settings.rungs`) stand where they do whatever is asked for, and each is marched to from the one below. So
buckles merge once on the way, not again for every stage, and a stage's folds are grown from those of the stage before.
A stage between two rungs is settled on a copy. What else was asked for never changes a stage's shape.
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

#: Shrinkage after which rest volumes are taken anew on the march, and the observer is told.
_SLICE = 0.01

#: Updates of the rest volumes before a state settles, steps between two, and their damping: what rings is gone by the
#: next. A march's volumes lag by 0.03 of shrinkage; those of a smooth start know no pressure.
_PRESSINGS, _PRESSINGS_OF_SMOOTH, _PRESSING_STEPS, _PRESSING_DAMPING = 2, 3, 150, 0.12

#: Height of bumps (rms) below which a sphere is smooth [te], and the latest onset of other fruits over the start.
_SMOOTH, _LATE_ONSET = 0.1, 3.0

#: Shrinkage that a stage may be off a rung by rounding.
_ROUNDING = 1e-9


class Path:
    """One fruit's way from fresh to dry."""

    def __init__(
        self,
        params: DehydrationParams,
        settings: Settings,
        context: Context,
        *,
        with_release: bool = False,
        with_energy: bool = True,
    ) -> None:
        self._asked = with_release, with_energy
        self._settings, self._context = settings, context
        self.motion = Motion(params, settings, context)
        self._rest = self.motion.rest
        self._state, self._velocity = new_state(self.motion.layout)
        # where the march set out last, and the steps made since
        self._foot, self._place = settings.start, 0
        self._above = [rung for rung in settings.rungs if rung > settings.start]
        self._settled: State | None = None
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
            masses = self.motion.masses
            state, velocity = self.motion.smooth(shrinkage)
            rest = self._pressed(state, velocity, self._rest, shrinkage, _PRESSINGS_OF_SMOOTH)
            found = self._settle(state, velocity, rest, shrinkage)
            self.motion.masses = masses
            return found
        if not self._begun:
            self._state, self._velocity = self.motion.smooth(settings.start)
            self._begun = True
        while self._above and self._above[0] < shrinkage + _ROUNDING:
            self._climb(self._above.pop(0), last)
        if self._settled is not None and abs(shrinkage - self._settled.shrinkage) < _ROUNDING:
            return self._settled
        self._march(shrinkage, last)
        state, velocity, masses = self._state.copy(), self._velocity.copy(), self.motion.masses
        found = self._settle(state, velocity, self._arrived(state, velocity, shrinkage), shrinkage)
        self.motion.masses = masses
        return found

    def _climb(self, shrinkage: float, last: float) -> None:
        """March to the next rung and settle there."""
        self._march(shrinkage, last)
        self._rest = self._arrived(self._state, self._velocity, shrinkage)
        self._settled = self._settle(self._state, self._velocity, self._rest, shrinkage)
        self._rest = self._settled.rest
        self._velocity[:] = 0
        self._foot, self._place = shrinkage, 0

    def _at(self, place: int) -> float:
        """Return the shrinkage after `place` steps from the foot."""
        return self._foot + place * self._settings.pace

    def _march(self, shrinkage: float, last: float) -> None:
        """March towards `shrinkage` in whole slices, whatever stages were asked for."""
        settings = self._settings
        target = int((shrinkage - self._foot) / settings.pace)
        chunk = max(20, min(self.motion.slice, round(_SLICE / settings.pace)))
        while self._place + chunk <= target:
            a, b = self._at(self._place), self._at(self._place + chunk)
            self._rest = self.motion.advance(self._state, self._velocity, self._rest, chunk, a, b, settings.damping)
            self._place += chunk
            self._context.report(b / last if last else 1.0, f"shrinkage s = {b:.3f}")

    def _arrived(self, state: Fixed, velocity: Singles, shrinkage: float) -> Floats:
        """Take what the march left to `shrinkage`, less than a slice, and return the rest volumes there."""
        rest = self._rest
        count = int((shrinkage - self._at(self._place)) / self._settings.pace)
        if count > 0:
            a, b = self._at(self._place), self._at(self._place + count)
            rest = self.motion.advance(state, velocity, rest, count, a, b, self._settings.damping)
        return self._pressed(state, velocity, rest, shrinkage, _PRESSINGS)

    def _pressed(self, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float, times: int) -> Floats:
        """Let rest volumes catch up with the pressure, and return them; state and velocity change in place."""
        for _ in range(times):
            rest = self.motion.advance(state, velocity, rest, _PRESSING_STEPS, shrinkage, shrinkage, _PRESSING_DAMPING)
        return rest

    def _settle(self, state: Fixed, velocity: Singles, rest: Floats, shrinkage: float) -> State:
        def smooth(state: Fixed) -> bool:
            return self._may_be_smooth(state, shrinkage)

        return settle(self.motion, state, velocity, rest, shrinkage, *self._asked, smooth)

    def _may_be_smooth(self, state: Fixed, shrinkage: float) -> bool:
        """Whether a state may have no buckles yet: of a sphere one sees it, of another fruit the shrinkage tells."""
        params = self.motion.params
        if shrinkage <= self._settings.start:
            return False
        if params.pattern is not None:
            return False  # it begins with wrinkles that anybody sees
        if not params.stays_spherical:
            return shrinkage < _LATE_ONSET * self._settings.start
        radius = np.linalg.norm(self.motion.surface(state), axis=1)
        return float(radius.std()) < _SMOOTH * params.exocarp_thickness
