"""A growing shell that is advanced from outside, in slices of time, while tools are added.

Growth goes in fixed steps: forget what is plastic, cut what is long, grow the rest state, find the equilibrium. A slice
may end anywhere within the search for an equilibrium; what comes out does not depend on the slices. A tool added
between slices starts with the next step, and `script` gives the parameters whose batch run is the same.
"""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from ..contract import Context, InvalidGeometry
from ..geometry.crossings import crossings
from .fresh import fresh
from .living.history import History, Moment
from .matter import thickest
from .params import GrowthParams
from .remeshing.remesh import MOST
from .settling.active import Habit
from .settling.impossible import check_outward, enclosed
from .settling.stage import settled
from .settling.tangent import Tangent
from .shapes import Mesh, start
from .solids import Solid
from .state import State
from .stepping import Carried, Steps
from .tooling.tools import Tool

__all__ = ["Engine", "Undone"]

#: How long a solid was there that is taken away with the step in which it came [growth time].
_INSTANT = 1e-9
#: Steps of a stage that settles free, after which it is looked whether parts pass through each other.
_LOOK = 8


class Undone(NamedTuple):
    """What was gone back over, and where that began."""

    taken: list[Moment]
    present: Moment


def _crossed(pairs: int, begun: Mesh) -> InvalidGeometry:
    """Return what to say of a start that passes through itself, as the shape does or only its unevenness."""
    said = f"passes through itself in {pairs} pairs of triangles."
    if crossings(begun.x, begun.triangles).count:
        return InvalidGeometry(f"the start shape {said}", advice="Mend the shape, or grow it with contact = 0.")
    return InvalidGeometry(
        f"the start shape, made uneven by `imperfection`, {said}",
        advice="Parts of it lie nearer to each other than it is uneven: move them apart, lower `imperfection`, or grow "
        "it with contact = 0.",
    )


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
        self.params, self.tolerance = params, tolerance
        self._tools, self._solids = list(params.tools), list(params.solids)
        self._keeps, self._history = history, History()
        self._work: Generator[State | None, None, None] | None = None
        #: Where the step under way has come to, None where there is none or it has only begun.
        self.underway: State | None = None
        begun = params.mesh.shape() if params.mesh else start(params.shape, vertices, params.aspect)
        self.state = fresh(params, begun)
        through = crossings(self.state.x, self.state.mesh.triangles).count if params.contact != 0 else 0
        if through:
            raise _crossed(through, begun)
        #: Of a closed surface.
        self._volume = 0.0 if len(self.state.mesh.border) else enclosed(begun)
        longest, largest = params.remesh * self.state.length, MOST * len(self.state.x)
        distance = thickest(self.state, params.thickness)
        self._way = Steps(params, tolerance, most, longest, largest, self._volume, distance)
        self._carried = Carried(Tangent(self.state.mesh), Habit(), params.contact or 0.0)
        self._steps = 0

    @property
    def residual(self) -> float:
        """Largest out-of-balance force of the last equilibrium, over mu l."""
        return self.state.forces

    @property
    def distance(self) -> float:
        """Return the distance that parts keep from each other, 0 as long as none has come near another."""
        return self._carried.distance

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
                self.underway = next(self._work) or self.underway
            except StopIteration:
                self._work = self.underway = None
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
            self._work = self.underway = None

    def _moment(self) -> Moment:
        return Moment(self._steps, self.state, tuple(self._tools), tuple(self._solids), self._carried)

    def _stand_at(self, moment: Moment) -> None:
        self._steps, self.state, tools, solids, self._carried = moment
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

    def reaching(self, time: float) -> Generator[State | None, None, State]:
        """Do what `reach` does; yields after every piece of work."""
        self._give_up()
        state, distance = yield from self._reached(time)
        free = self.params.contact is None and not distance
        found = yield from self._settled(state, distance, free)
        watch = self._way.watch(state)
        if found is None or (free and not (yield from watch.apart(state.x, found))):
            found = yield from self._settled(state, watch.distance)
            assert found is not None  # it is not free
        check_outward(found, self._volume, self.state.time, self.params)
        return found

    def _settled(self, found: State, distance: float, free: bool = False) -> Generator[None, None, State | None]:
        """Settle a state; None where it may move as if parts passed through each other, and they do on the way."""
        for taken, nearer in enumerate(settled(found, self.script, self.tolerance, distance), 1):
            found = nearer
            if free and taken % _LOOK == 0 and crossings(found.x, found.mesh.triangles).count:
                return None
            yield
        return found

    def _reached(self, time: float) -> Generator[State | None, None, tuple[State, float]]:
        """Find the state at a growth time as the way on leaves it, and the distance that its parts keep."""
        while (self._steps + 1) * self.params.step <= time + 1e-9:
            yield from self._step(self.params.step)
        rest = time - self._steps * self.params.step
        if rest <= 1e-9 and self._steps:
            return self.state, self._carried.distance
        # a step of its own, which leaves no trace
        fresh = self._carried._replace(tangent=Tangent(self.state.mesh), habit=Habit())
        tools, solids = tuple(self._tools), tuple(self._solids)
        state, carried = yield from self._way.step(self.state, fresh, tools, solids, max(rest, 0.0))
        return state, carried.distance

    def _step(self, dt: float) -> Generator[State | None, None, None]:
        """Grow by dt and find the equilibrium; yields after every piece of work."""
        kept = self._moment()
        self.state, self._carried = yield from self._way.step(self.state, self._carried, kept.tools, kept.solids, dt)
        if self._keeps:
            self._history.remember(kept)
        self._steps += 1
