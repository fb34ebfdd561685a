"""One step of growth: what is plastic forgotten, a mesh that fits, the rest state grown, the equilibrium found.

Unless a distance is asked for, contact costs what it is needed for: a step is taken as if parts could pass through each
other, and looked at. Where none came near another it stands as it is, to the last bit. Where some did it is taken anew
with contact from before, where all was apart, and so are all that follow.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from .. import shell
from .matter import grown_further, thickened, thickest
from .params import GrowthParams
from .plastic import forgotten
from .remeshing.remesh import remesh
from .settling.active import Habit
from .settling.energy import StepEnergy
from .settling.equilibrium import balanced, begun
from .settling.impossible import check_held, check_outward
from .settling.minimise import Point
from .settling.tangent import Tangent
from .settling.watch import Watch
from .solids import Solid, present
from .state import State
from .tooling.placing import branched, started
from .tooling.rates import grown, rates, thickening
from .tooling.tools import Tool

__all__ = ["Carried", "Pieces", "Steps"]


#: How much finer the way is settled of a shape without imperfection, of which only rounding says how it comes to its
#: residual: what steps leave over goes into the rest state where a tool's reach is measured on the bent shape.
_PERFECT = 0.01
#: How much of what compression pushes now is laid in a step, the rest being that of the step before: it takes away what
#: it comes from, and all of it at once would swing to and fro.
_GRADUALLY = 0.25


class Carried(NamedTuple):
    """What a step takes over from the one before, beside the state."""

    tangent: Tangent
    habit: Habit
    #: That parts keep from each other, 0 as long as none has come near another.
    distance: float


#: Pieces of work, after each of which it is said where the shape has come to on its way to the step's end, if anywhere.
Pieces: TypeAlias = Generator[State | None, None, tuple[State, Carried]]


@dataclass(frozen=True, eq=False)
class Steps:
    """How a run takes its steps.

    tolerance: residual; most: steps to an equilibrium. longest: rest edge that is not cut; largest: vertices at most.
    volume: inside a closed surface, 0 of others. distance: that parts keep from each other once they are near, as
    long as nothing is thicker.
    """

    params: GrowthParams
    tolerance: float
    most: int
    longest: float
    largest: int
    volume: float
    distance: float
    _watches: dict[float, Watch] = field(default_factory=dict)

    def watch(self, state: State) -> Watch:
        """Return what watches over parts that come nearer each other than a state's sheet is thick."""
        distance = max(self.distance, thickest(state, self.params.thickness))
        if distance not in self._watches:
            # what it remembers is of another distance
            self._watches.clear()
            self._watches[distance] = Watch(distance)
        return self._watches[distance]

    def step(
        self, before: State, carried: Carried, tools: Sequence[Tool], solids: Sequence[Solid], dt: float
    ) -> Pieces:
        """Grow by dt and find the equilibrium; yields after every piece of work.

        Raises:
            NotConverged: an equilibrium was not found. Unstable: the shape left the finite, or is inside out.
            OverBudget: too many vertices.

        """
        found = yield from self._taken(before, carried, tools, solids, dt)
        meshed, state, after = found
        if self.params.contact is None and not carried.distance:
            watch = self.watch(state)
            clear = meshed is before or watch.clear(meshed)
            yield None
            if not (clear and (yield from watch.apart(meshed.x, state))):
                yield None
                near = carried._replace(distance=watch.distance)
                _, state, after = yield from self._taken(before, near, tools, solids, dt)
        return state, after

    @property
    def _material(self) -> shell.Material:
        return shell.Material(self.params.thickness, self.params.poisson)

    def _taken(
        self, before: State, carried: Carried, tools: Sequence[Tool], solids: Sequence[Solid], dt: float
    ) -> Generator[State | None, None, tuple[State, State, Carried]]:
        """Take a step; the value is the state on the step's mesh, the one at its end, and what is carried."""
        p = self.params
        # the way on from here is the same after an undo only with the same inverse
        carried = carried._replace(tangent=carried.tangent.copy())
        meshed, carried = yield from self._readied(before, carried)
        state = started(meshed, tools, p.step, p.seed)
        middle = state.time + dt / 2
        acting = dict(enumerate(tools))
        now = {k: t for k, t in acting.items() if t.start <= middle}
        g, rest = grown(state, rates(state, now, middle), dt)
        thicker = thickening(state, now, middle)
        yield None
        state = replace(state, g=g, rest=rest, time=state.time + dt, matter=grown_further(state, g))
        state = thickened(state, thicker, dt)
        if carried.distance and p.contact is None:
            # what was near keeps apart by the sheet as it is now
            carried = carried._replace(distance=max(carried.distance, thickest(state, p.thickness)))
        distance = carried.distance
        if "led" in state.matter:
            state = replace(state, x=state.x + np.where(state.held, dt * state.matter["led"], 0.0))
        there = present(solids, state.time)
        loads = p.pressure, there, carried.tangent, p.gravity, distance, p.bending
        energy = StepEnergy(state, self._material, *loads, pushing=p.normal_force)
        energy.lay(state.matter.get("pushed"), _GRADUALLY)
        goal = self.tolerance * state.length * (1.0 if p.imperfection else _PERFECT)
        if not there and not energy.bed:
            # whatever the shape, nothing will take up what pulls now
            check_held(energy, state, goal, before.time)
        yield None
        first = yield from begun(energy, meshed, dt, goal, p, carried.habit)
        way = balanced(energy, first.x, first.spent, goal, self.most, p, before.time)
        point, spent = yield from _seen(way, state)
        forces = point.gradient / state.length
        drift = (point.x - state.x) / dt if dt else None
        if energy.pushed is not None:
            state = replace(state, matter=state.matter | {"pushed": energy.pushed})
        state = replace(state, x=point.x, forces=forces, iterations=state.iterations + max(spent - 1, 0), drift=drift)
        # where rounding ends the search, more may be left than was asked for
        check_held(energy, state, max(goal, point.gradient), before.time)
        check_outward(state, self.volume, before.time, p)
        state = branched(state, acting, p.seed)
        yield None
        return meshed, state, carried._replace(habit=first.habit)

    def _readied(self, state: State, carried: Carried) -> Generator[None, None, tuple[State, Carried]]:
        """Find the state from which a step grows: what is plastic forgotten, on a mesh that fits; yields in between.

        Both disturb the equilibrium. So they come before a step's growth, not after it: what is returned is settled on
        the mesh and against the rest state that are returned with it.
        """
        p = self.params
        if p.plasticity and state.time:
            state = replace(state, g=forgotten(state, p.plasticity, p.yield_strain))
        if not p.remesh:
            return state, carried
        finer, changes = yield from remesh(state, self.longest, self.largest, apart=carried.distance > 0)
        tangent, habit = carried.tangent, carried.habit
        for pairs in changes:
            tangent = tangent.remeshed(finer.mesh, pairs)
        if finer.mesh is not state.mesh:
            tangent = tangent if changes else Tangent(finer.mesh, tangent.inverse)
            habit = habit.remeshed(finer.mesh, changes)
        return finer, carried._replace(tangent=tangent, habit=habit)


def _seen(way: Generator[Point, None, tuple[Point, int]], state: State) -> Generator[State, None, tuple[Point, int]]:
    """Follow the search for a state's equilibrium; yields the state where it has come to."""
    while True:
        try:
            point = next(way)
        except StopIteration as end:
            found: tuple[Point, int] = end.value
            return found
        yield replace(state, x=point.x, forces=point.gradient / state.length)
