"""A growing shell that is advanced from outside, in slices of time, while tools are added.

Growth goes in fixed steps: grow the rest state, find the equilibrium, forget what is plastic, cut what is long. A slice
may end anywhere within the search for an equilibrium; what comes out does not depend on the slices. A tool added
between slices starts with the next step, and `script` gives the parameters whose batch run is the same.
"""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .. import shell
from ..contract import Context, NotConverged, Unstable
from ..shell.inverse import normals
from .active import Habit, settle
from .energy import StepEnergy, Tangent, ahead
from .minimise import Point, conjugate_gradients, lbfgs, quasi_newton
from .params import GrowthParams
from .places import share
from .placing import border, branched, started
from .plastic import forgotten
from .rates import grown, rates
from .remesh import remesh
from .shapes import Mesh, start
from .state import State
from .tools import Tool

__all__ = ["Engine"]

Floats = NDArray[np.float64]

_WAYS = {"quasi_newton": quasi_newton, "lbfgs": lbfgs, "cg": conjugate_gradients}
#: Steps that can be undone so that the same way on gives the same bytes; beyond, the same to the residual.
_EXACT = 30
#: Waves that nudge a perfect shape: height over the thickness, and waves over the shape's width.
_NUDGE, _WAVES = 0.2, (1, 2, 4)
#: A mesh does not grow beyond this many times its first vertices.
_MOST = 20


class Engine:
    """A run that can be advanced, given tools, and undone."""

    def __init__(
        self, params: GrowthParams, vertices: int, tolerance: float = 1e-3, most: int = 4000, history: bool = True
    ) -> None:
        """Start from the parameters' shape with about `vertices`; tolerance: residual; most: steps to an equilibrium.

        history: whether states are kept for `undo`.

        Raises:
            InvalidInput: a tool or an attachment that the shape cannot have.

        """
        self.params, self.tolerance, self._most = params, tolerance, most
        self._material = shell.Material(params.thickness, params.poisson)
        self._tools: list[Tool] = list(params.tools)
        self._keeps = history
        self._history: list[tuple[State, int, Tangent, Habit]] = []
        self._work: Generator[None, None, None] | None = None
        self.state = _begin(params, start(params.shape, vertices, params.aspect))
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
        """Return the state at a growth time; the run itself stays at the last whole step before it.

        Raises:
            NotConverged, Unstable: as `advance`. Cancelled: the observer asked to stop.

        """
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
        state = started(before, self._tools, self.params.step, self.params.seed)
        middle = state.time + dt / 2
        acting = dict(enumerate(self._tools[:tools]))
        g, rest = grown(state, rates(state, {k: t for k, t in acting.items() if t.start <= middle}, middle), dt)
        yield
        state = replace(state, g=g, rest=rest, time=state.time + dt)
        point, spent = Point(state.x, 0.0, np.inf), 0
        p = self.params
        tangent = self._tangent
        energy = StepEnergy(state, self._material, p.pressure, p.solids, tangent, p.gravity, p.contact, p.bending)
        goal = self.tolerance * state.length
        yield
        if p.active and p.imperfection and not p.contact:
            now, last = g.T, before.g.T
            changed = (now[0] != last[0]) | (now[1] != last[1]) | (now[2] != last[2])
            if rest is not before.rest:
                changed[state.mesh.hinge_faces[rest != before.rest]] = True
            settled = yield from settle(energy, changed, goal, dt, self._habit.copy(), _WAYS[p.solver])
            begin, spent, self._habit = settled.x, settled.spent, settled.habit
        else:
            begin = ahead(energy, state, dt)
        nudges = 0 if p.imperfection else 1
        while True:
            for nearer in _WAYS[self.params.solver](energy, begin):
                spent += nearer.x is not point.x
                point = nearer
                if point.gradient <= goal or point.stuck:
                    break
                if not np.isfinite(point.gradient):
                    raise Unstable("the shape left the finite.", advice="Take a shorter step.", last_stage=before.time)
                if spent > self._most:
                    break
                yield
            begin = _nudged(energy, point.x, point.energy, self.params.seed) if nudges else point.x
            nudges -= 1
            if begin is point.x:
                break
        # a goal below what the digits hold is met where rounding is
        if not (point.gradient <= goal or point.gradient <= energy.rounding(point.x)):
            raise NotConverged(
                f"no equilibrium at growth time {state.time:g}: residual {point.gradient / state.length:.1e}.",
                advice="Take a shorter step or a thicker sheet.",
                last_stage=before.time,
                residual=point.gradient / state.length,
            )
        forces = point.gradient / state.length
        drift = (point.x - state.x) / dt if dt else None
        state = replace(state, x=point.x, forces=forces, iterations=state.iterations + spent - 1, drift=drift)
        if self.params.plasticity:
            state = replace(state, g=forgotten(state, self.params.plasticity, self.params.yield_strain))
        state = branched(state, acting, self.params.seed)
        yield
        if self.params.remesh:
            finer, changes = yield from remesh(state, self._longest, self._largest)
            tangent = self._tangent
            for pairs in changes:
                tangent = tangent.remeshed(finer.mesh, pairs)
            if finer.mesh is not state.mesh:
                self._tangent = tangent if changes else Tangent(finer.mesh, tangent.inverse)
                self._habit = self._habit.remeshed(finer.mesh, changes)
            state = finer
        if self._keeps:
            self._remember(before, tools, *kept)
        self.state = state
        self._steps += 1

    def _remember(self, before: State, tools: int, tangent: Tangent, habit: Habit) -> None:
        """Keep what `undo` goes back to; inverses of the last steps only, for they are large."""
        self._history.append((before, tools, tangent, habit))
        if len(self._history) > _EXACT:
            state, tools, old, _ = self._history[-_EXACT - 1]
            old.inverse = None
            self._history[-_EXACT - 1] = (state, tools, old, Habit())


def _nudged(energy: StepEnergy, x: Floats, least: float, seed: int) -> Floats:
    """Return x with small waves if that lowers the energy, else x itself.

    A perfect shape sits on its symmetry, in balance but not at rest: only so it finds the way out.
    """
    found, generator = x, Context.generator(seed)
    normal = np.where(energy.free, normals(x, energy.state.mesh.triangles), 0.0)
    for waves in _WAVES:
        ways = generator.normal(size=(16, 3)) * (2 * np.pi * waves / float(np.ptp(x, axis=0).max()))
        height = np.cos(x @ ways.T + generator.uniform(0, 2 * np.pi, 16)).sum(axis=1) / 4
        trial = x + (_NUDGE * energy.material.thickness * height)[:, None] * normal
        value = energy(trial)[0]
        if value < least:
            found, least = trial, value
    return found


def _begin(params: GrowthParams, mesh: Mesh) -> State:
    """Return the start: rest state of the perfect shape, shape with its imperfection."""
    top = shell.topology(mesh.triangles, len(mesh.x))
    p = mesh.x[mesh.triangles]
    normals = np.zeros_like(mesh.x)
    np.add.at(normals, mesh.triangles, np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, None, :])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offset = Context.generator(params.seed).normal(size=len(mesh.x)) * params.imperfection * params.thickness
    held = np.zeros(mesh.x.shape, bool)
    for attachment in params.attached:
        inside = share(attachment.where, mesh, border(top), params.seed) >= 0.5
        held[np.ix_(np.flatnonzero(inside), np.array(["xyz".index(axis) for axis in attachment.axes]))] = True
    angles = shell.angles(mesh.x, top.hinges)
    x = mesh.x + np.where(held, 0.0, offset[:, None] * normals)
    return State(
        time=0.0,
        x=x,
        mesh=top,
        g=shell.metric(mesh.x, mesh.triangles),
        rest=angles if params.curved else np.zeros_like(angles),
        shares={},
        held=held,
        spots={},
        curves={},
    )
