"""A growing shell that is advanced from outside, in slices of time, while tools are added.

Growth goes in fixed steps: forget what is plastic, cut what is long, grow the rest state, find the equilibrium. A slice
may end anywhere within the search for an equilibrium; what comes out does not depend on the slices. A tool added
between slices starts with the next step, and `script` gives the parameters whose batch run is the same.
"""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .. import shell
from ..contract import Context, InvalidGeometry
from ..geometry.crossings import crossings
from .fresh import fresh
from .living.history import History, Moment
from .matter import grown_further
from .params import GrowthParams, Solid, present
from .plastic import forgotten
from .remeshing.remesh import MOST, remesh
from .settling.active import Habit
from .settling.energy import StepEnergy
from .settling.equilibrium import balanced, begun
from .settling.impossible import check_held, check_outward, enclosed
from .settling.stage import settled
from .settling.tangent import Tangent
from .shapes import start
from .state import State
from .tooling.placing import branched, started
from .tooling.rates import grown, rates
from .tooling.tools import Tool

__all__ = ["Engine", "Undone"]

#: How long a solid was there that is taken away with the step in which it came [growth time].
_INSTANT = 1e-9


class Undone(NamedTuple):
    """What was gone back over, and where that began."""

    taken: list[Moment]
    present: Moment


class Engine:
    """A run that can be advanced, given tools, and undone."""

    def __init__(
        self, params: GrowthParams, vertices: int, tolerance: float = 1e-3, most: int = 4000, history: bool = True
    ) -> None:
        """Start from the parameters' shape with about `vertices`, or from their mesh.

        tolerance: residual; most: steps to an equilibrium.

        history: whether states are kept for `undo`.

        Raises:
            InvalidInput: a tool or an attachment that the shape cannot have.
            InvalidGeometry: a shape that passes through itself, unless it may.

        """
        self.params, self.tolerance, self._most = params, tolerance, most
        self._material = shell.Material(params.thickness, params.poisson)
        self._tools, self._solids = list(params.tools), list(params.solids)
        self._keeps, self._history = history, History()
        self._work: Generator[None, None, None] | None = None
        begun = params.mesh.shape() if params.mesh else start(params.shape, vertices, params.aspect)
        self.state = fresh(params, begun)
        through = crossings(self.state.x, self.state.mesh.triangles).count if params.contact else 0
        if through:
            raise InvalidGeometry(
                f"the start shape passes through itself in {through} pairs of triangles.",
                advice="Mend the shape, or grow it with contact = 0.",
            )
        #: Of a closed surface.
        self._volume = 0.0 if len(self.state.mesh.border) else enclosed(begun)
        self._longest = params.remesh * self.state.length
        self._largest = MOST * len(self.state.x)
        self._tangent, self._habit = Tangent(self.state.mesh), Habit()
        #: Those of before the step that is under way.
        self._before = self._tangent, self._habit
        self._steps = 0

    @property
    def residual(self) -> float:
        """Largest out-of-balance force of the last equilibrium, over mu l."""
        return self.state.forces

    @property
    def script(self) -> GrowthParams:
        """Return the parameters of which this run is the batch run."""
        return self.params.model_copy(update={"tools": tuple(self._tools), "solids": tuple(self._solids)})

    @property
    def steps(self) -> int:
        """Steps that are done."""
        return self._steps

    @property
    def following(self) -> float:
        """When the next step starts that has not begun."""
        return (self._steps + (self._work is not None)) * self.params.step

    def add(self, tool: Tool) -> int:
        """Let a tool act from the next step on: its start is put there if it lies before. Returns its number."""
        self._tools.append(tool.model_copy(update={"start": max(tool.start, self.following)}))
        return len(self._tools) - 1

    def change(self, number: int, tool: Tool) -> None:
        """Put a tool into another's place, from which it differs from the next step on at the earliest."""
        self._tools[number] = tool

    def end(self, number: int) -> None:
        """End a tool with the next step."""
        tool = self._tools[number]
        lasts = max(self.following - tool.start, _INSTANT)
        self._tools[number] = tool.model_copy(update={"duration": min(tool.duration, lasts)})

    def put(self, solid: Solid) -> int:
        """Let a solid be there from the next step on. Returns its number."""
        self._solids.append(solid.model_copy(update={"start": max(solid.start, self.following)}))
        return len(self._solids) - 1

    def take(self, number: int) -> None:
        """Take a solid away with the next step."""
        solid = self._solids[number]
        lasted = max(self.following - solid.start, _INSTANT)
        self._solids[number] = solid.model_copy(update={"duration": min(solid.duration, lasted)})

    def advance(self, budget: float, until: float = np.inf) -> bool:
        """Work for about `budget` seconds; return whether a step was completed. Goes no further than `until`.

        Whatever the budget, one piece of the work is done, of some milliseconds.

        Raises:
            NotConverged: an equilibrium was not found; the state before the step stands.
            Unstable: the shape left the finite.

        """
        end, completed, first = clock.perf_counter() + budget, False, True
        while (first or clock.perf_counter() < end) and (self._steps + 1) * self.params.step <= until + 1e-9:
            first = False
            if self._work is None:
                self._work = self._step(self.params.step)
            try:
                next(self._work)
            except StopIteration:
                self._work = None
                completed = True
            except Exception:
                self._give_up()
                raise
        return completed

    def undo(self) -> bool:
        """Go back by one step, and drop tools and solids added since; return whether there was one.

        Raises:
            SolverError: what lay between a moment that was kept and that step does not come out again.

        """
        # the step before the one under way is undone, and that one given up
        self._give_up()
        steps = self._steps - 1
        if not self._history:
            return False
        tools = next((moment.tools, moment.solids) for moment in reversed(self._history) if moment.steps <= steps)
        self.back(steps)
        if self._steps < steps:
            self._tools, self._solids = list(tools[0]), list(tools[1])
            while self._steps < steps:
                self.advance(np.inf, until=steps * self.params.step)
        return True

    def back(self, steps: int) -> Undone:
        """Go back to where so many steps were done, or to the nearest moment before that was kept.

        Returns what `forth` takes. From such a moment the way on is the same to the last bit.
        """
        self._give_up()
        present = self._moment()
        taken = self._history.back_to(steps) if steps < self._steps else []
        if taken:
            self._stand_at(taken[0])
        return Undone(taken, present)

    def forth(self, undone: Undone) -> None:
        """Be again where `back` was called; whatever came after it is given up."""
        self._give_up()
        if undone.taken:
            self._history.back_to(undone.taken[0].steps)
        self._history.extend(undone.taken)
        self._stand_at(undone.present)

    def lay(self, tools: tuple[Tool, ...], solids: tuple[Solid, ...]) -> None:
        """Let these be the tools and solids, which differ from what there was from the next step on at the earliest."""
        self._tools, self._solids = list(tools), list(solids)

    def _give_up(self) -> None:
        """Leave the step off that is under way, without a trace."""
        if self._work is not None:
            self._work.close()
            self._work = None
            self._tangent, self._habit = self._before

    def _moment(self) -> Moment:
        return Moment(self._steps, self.state, tuple(self._tools), tuple(self._solids), self._tangent, self._habit)

    def _stand_at(self, moment: Moment) -> None:
        self._steps, self.state, tools, solids, self._tangent, self._habit = moment
        self._tools, self._solids = list(tools), list(solids)

    def reach(self, time: float, context: Context) -> State:
        """Return the state at a growth time, settled by `stage.settled`; the run stays at the last whole step before.

        Raises:
            NotConverged, Unstable: as `advance`. Cancelled: the observer asked to stop.

        """
        work = self.reaching(time)
        while True:
            try:
                next(work)
            except StopIteration as end:
                found: State = end.value
                return found
            context.check_cancelled()

    def reaching(self, time: float) -> Generator[None, None, State]:
        """Do what `reach` does; yields after every piece of work."""
        self._give_up()
        found = yield from self._reached(time)
        for nearer in settled(found, self.script, self.tolerance):
            found = nearer
            yield
        check_outward(found, self._volume, self.state.time, self.params)
        return found

    def _reached(self, time: float) -> Generator[None, None, State]:
        """Find the state at a growth time as the way on leaves it."""
        while (self._steps + 1) * self.params.step <= time + 1e-9:
            yield from self._step(self.params.step)
        rest = time - self._steps * self.params.step
        if rest <= 1e-9 and self._steps:
            return self.state
        # a step of its own, which leaves no trace
        kept = self.state, History(self._history), self._tangent, self._habit, self._steps
        self._tangent, self._habit = Tangent(self.state.mesh), Habit()
        try:
            yield from self._step(max(rest, 0.0))
            return self.state
        finally:
            self.state, self._history, self._tangent, self._habit, self._steps = kept

    def _step(self, dt: float) -> Generator[None, None, None]:
        """Grow by dt and find the equilibrium; yields after every piece of work."""
        # the way on from here is the same after an undo only with the same inverse
        kept = self._moment()
        before, self._before, self._tangent = self.state, (self._tangent, self._habit), self._tangent.copy()
        meshed = yield from self._readied(before)
        state = started(meshed, kept.tools, self.params.step, self.params.seed)
        middle = state.time + dt / 2
        acting = dict(enumerate(kept.tools))
        g, rest = grown(state, rates(state, {k: t for k, t in acting.items() if t.start <= middle}, middle), dt)
        yield
        state = replace(state, g=g, rest=rest, time=state.time + dt, matter=grown_further(state, g))
        p = self.params
        tangent = self._tangent
        solids = present(kept.solids, state.time)
        energy = StepEnergy(state, self._material, p.pressure, solids, tangent, p.gravity, p.contact, p.bending)
        goal = self.tolerance * state.length
        yield
        first = yield from begun(energy, meshed, dt, goal, p, self._habit)
        self._habit = first.habit
        point, spent = yield from balanced(energy, first.x, first.spent, goal, self._most, p, before.time)
        forces = point.gradient / state.length
        drift = (point.x - state.x) / dt if dt else None
        state = replace(state, x=point.x, forces=forces, iterations=state.iterations + spent - 1, drift=drift)
        check_held(energy, state, goal, before.time)
        check_outward(state, self._volume, before.time, p)
        state = branched(state, acting, self.params.seed)
        yield
        if self._keeps:
            self._history.remember(kept)
        self.state = state
        self._steps += 1

    def _readied(self, state: State) -> Generator[None, None, State]:
        """Find the state from which a step grows: what is plastic forgotten, on a mesh that fits; yields in between.

        Both disturb the equilibrium. So they come before a step's growth, not after it: what is returned is settled on
        the mesh and against the rest state that are returned with it.
        """
        if self.params.plasticity and self._steps:
            state = replace(state, g=forgotten(state, self.params.plasticity, self.params.yield_strain))
        if not self.params.remesh:
            return state
        finer, changes = yield from remesh(state, self._longest, self._largest, apart=self.params.contact > 0)
        tangent = self._tangent
        for pairs in changes:
            tangent = tangent.remeshed(finer.mesh, pairs)
        if finer.mesh is not state.mesh:
            self._tangent = tangent if changes else Tangent(finer.mesh, tangent.inverse)
            self._habit = self._habit.remeshed(finer.mesh, changes)
        return finer
