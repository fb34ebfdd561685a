"""A growing shell that is advanced from outside, in slices of time, while tools are added.

Growth goes in fixed steps: forget what is plastic, cut what is long, grow the rest state, find the equilibrium. A slice
may end anywhere within the search for an equilibrium; what comes out does not depend on the slices. A tool added
between slices starts with the next step, and `script` gives the parameters whose batch run is the same.
"""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from dataclasses import replace

import numpy as np

from .. import shell
from ..contract import Context, InvalidGeometry
from ..geometry.crossings import crossings
from .fresh import fresh
from .matter import grown_further
from .params import GrowthParams
from .plastic import forgotten
from .remeshing.remesh import remesh
from .settling.active import Habit
from .settling.energy import StepEnergy
from .settling.equilibrium import balanced, begun
from .settling.stage import settled
from .settling.tangent import Tangent
from .shapes import start
from .state import State
from .tooling.placing import branched, started
from .tooling.rates import grown, rates
from .tooling.tools import Tool

__all__ = ["Engine"]

#: Steps that can be undone so that the same way on gives the same bytes; beyond, the same to the residual.
_EXACT = 30
#: A mesh does not grow beyond this many times its first vertices.
_MOST = 20


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
        self._tools: list[Tool] = list(params.tools)
        self._keeps = history
        self._history: list[tuple[State, int, Tangent, Habit]] = []
        self._work: Generator[None, None, None] | None = None
        begun = params.mesh.shape() if params.mesh else start(params.shape, vertices, params.aspect)
        self.state = fresh(params, begun)
        through = crossings(self.state.x, self.state.mesh.triangles).count if params.contact else 0
        if through:
            raise InvalidGeometry(
                f"the start shape passes through itself in {through} pairs of triangles.",
                advice="Mend the shape, or grow it with contact = 0.",
            )
        self._longest = params.remesh * self.state.length
        self._largest = _MOST * len(self.state.x)
        self._tangent, self._habit = Tangent(self.state.mesh), Habit()
        self._steps = 0

    @property
    def residual(self) -> float:
        """Largest out-of-balance force of the last equilibrium, over mu l."""
        return self.state.forces

    @property
    def script(self) -> GrowthParams:
        """Return the parameters of which this run is the batch run."""
        return self.params.model_copy(update={"tools": tuple(self._tools)})

    def add(self, tool: Tool) -> None:
        """Let a tool act from the next step on: its start is put there if it lies before."""
        following = (self._steps + (self._work is not None)) * self.params.step
        self._tools.append(tool.model_copy(update={"start": max(tool.start, following)}))

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
                self._work = None
                raise
        return completed

    def undo(self) -> bool:
        """Go back by one step, and drop tools added since; return whether there was one."""
        if self._work is not None:
            # the step before the one under way is undone, and that one given up
            self._work.close()
            self._work = None
        if not self._history:
            return False
        self.state, tools, self._tangent, self._habit = self._history.pop()
        self._steps -= 1
        del self._tools[tools:]
        return True

    def reach(self, time: float, context: Context) -> State:
        """Return the state at a growth time, settled by `stage.settled`; the run stays at the last whole step before.

        Raises:
            NotConverged, Unstable: as `advance`. Cancelled: the observer asked to stop.

        """
        found = self._reached(time, context)
        for nearer in settled(found, self.params, self.tolerance):
            found = nearer
            context.check_cancelled()
        return found

    def _reached(self, time: float, context: Context) -> State:
        """Return the state at a growth time as the way on leaves it."""
        while (self._steps + 1) * self.params.step <= time + 1e-9:
            for _ in self._step(self.params.step):
                context.check_cancelled()
        rest = time - self._steps * self.params.step
        if rest <= 1e-9 and self._steps:
            return self.state
        # a step of its own, which leaves no trace
        kept = self.state, list(self._history), self._tangent, self._habit, self._steps
        self._tangent, self._habit = Tangent(self.state.mesh), Habit()
        try:
            for _ in self._step(max(rest, 0.0)):
                context.check_cancelled()
            return self.state
        finally:
            self.state, self._history, self._tangent, self._habit, self._steps = kept

    def _step(self, dt: float) -> Generator[None, None, None]:
        """Grow by dt and find the equilibrium; yields after every piece of work."""
        before, tools = self.state, len(self._tools)
        # the way on from here is the same after an undo only with the same inverse
        kept, self._tangent = (self._tangent, self._habit), self._tangent.copy()
        meshed = yield from self._readied(before)
        state = started(meshed, self._tools, self.params.step, self.params.seed)
        middle = state.time + dt / 2
        acting = dict(enumerate(self._tools[:tools]))
        g, rest = grown(state, rates(state, {k: t for k, t in acting.items() if t.start <= middle}, middle), dt)
        yield
        state = replace(state, g=g, rest=rest, time=state.time + dt, matter=grown_further(state, g))
        p = self.params
        tangent = self._tangent
        energy = StepEnergy(state, self._material, p.pressure, p.solids, tangent, p.gravity, p.contact, p.bending)
        goal = self.tolerance * state.length
        yield
        first = yield from begun(energy, meshed, dt, goal, p, self._habit)
        self._habit = first.habit
        point, spent = yield from balanced(energy, first.x, first.spent, goal, self._most, p, before.time)
        forces = point.gradient / state.length
        drift = (point.x - state.x) / dt if dt else None
        state = replace(state, x=point.x, forces=forces, iterations=state.iterations + spent - 1, drift=drift)
        state = branched(state, acting, self.params.seed)
        yield
        if self._keeps:
            self._remember(before, tools, *kept)
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

    def _remember(self, before: State, tools: int, tangent: Tangent, habit: Habit) -> None:
        """Keep what `undo` goes back to; inverses of the last steps only, for they are large."""
        self._history.append((before, tools, tangent, habit))
        if len(self._history) > _EXACT:
            state, tools, old, _ = self._history[-_EXACT - 1]
            old.inverse = None
            self._history[-_EXACT - 1] = (state, tools, old, Habit())
