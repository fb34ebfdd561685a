"""The search for a step's equilibrium: parts first where that is asked for, the whole, and a nudge off symmetry."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import numpy as np

from ...arrays import Floats
from ...contract import NotConverged, Unstable
from ..params import GrowthParams
from ..state import State
from .active import Habit, Settled, settle
from .coarser import begun_coarser
from .energy import StepEnergy, ahead
from .impossible import check_near
from .minimise import Point, conjugate_gradients, lbfgs, quasi_newton
from .newton import ASIDE, bending, newton
from .nudges import across, nudged

__all__ = ["balanced", "begun"]


_WAYS = {"quasi_newton": quasi_newton, "lbfgs": lbfgs, "cg": conjugate_gradients}
#: Steps after which quasi-Newton has stalled, and Newton's method takes over: its factorisations are no small pieces.
_STALLED = 400
#: Thickness over edges beyond which a sheet is no shell of its triangles.
_THICK = 2.0


def begun(
    energy: StepEnergy, before: State, dt: float, goal: float, params: GrowthParams, habit: Habit
) -> Generator[None, None, Settled]:
    """Find where the search for the whole begins, from the state before the step; yields after pieces of work."""
    state = energy.state
    if not (params.active and params.imperfection and not energy.touching):
        x = ahead(energy, state, dt)
        if params.solver == "quasi_newton" and not energy.touching:
            x = yield from begun_coarser(energy, x, goal)
        return Settled(x, 0, habit)
    now, last = state.g.T, before.g.T
    changed = (now[0] != last[0]) | (now[1] != last[1]) | (now[2] != last[2])
    if state.rest is not before.rest:
        changed[state.mesh.hinge_faces[state.rest != before.rest]] = True
    return (yield from settle(energy, changed, goal, dt, habit.copy(), _WAYS[params.solver]))


def balanced(
    energy: StepEnergy, begin: Floats, spent: int, goal: float, most: int, params: GrowthParams, last: float
) -> Generator[Point, None, tuple[Point, int]]:
    """Find the equilibrium from `begin` (n, 3), after `spent` of at most `most` steps; yields where it has come to.

    goal: largest force. last: growth time of the state before. The generator's value is the equilibrium and the steps.

    Raises:
        NotConverged: it was not found.
        Unstable: the shape left the finite.

    """
    state, point = energy.state, Point(energy.state.x, 0.0, np.inf)
    nudges = 0 if params.imperfection else 1
    while True:
        for nearer in _down(energy, begin, params.solver):
            spent += nearer.x is not point.x
            point = nearer
            if point.gradient <= goal or point.stuck:
                break
            if not np.isfinite(point.gradient):
                raise Unstable("the shape left the finite.", advice="Take a shorter step.", last_stage=last)
            if energy.load is not None:
                check_near(state, point.x, last)
            if spent > most:
                break
            yield point
        begin = _off(energy, point, params.seed) if nudges else point.x
        nudges -= 1
        if begin is point.x:
            break
    # a goal below what the digits hold is met where rounding is
    if not (point.gradient <= goal or point.gradient <= energy.rounding(point.x)):
        raise NotConverged(
            f"no equilibrium at growth time {state.time:g}: residual {point.gradient / state.length:.1e}.",
            advice=_advice(params, state),
            last_stage=last,
            residual=point.gradient / state.length,
        )
    return point, spent


def _off(energy: StepEnergy, point: Point, seed: int) -> Floats:
    """Return where a shape goes on from a point of balance: off it where that is a saddle."""
    if not energy.curved:
        return nudged(energy, point.x, point.energy, seed)
    return bending(energy, point.x, across(energy, point.x, seed), ASIDE * energy.state.length)[1]


def _advice(params: GrowthParams, state: State) -> str:
    if params.thickness > _THICK * state.length:
        return "Take a shorter step, or a thinner sheet: this one is much thicker than its triangles are wide."
    return "Take a shorter step or a thicker sheet."


def _down(energy: StepEnergy, begin: Floats, way: str) -> Iterator[Point]:
    """Go down the asked way; where quasi-Newton stalls, by Newton's method from there, and on if that sticks."""
    point, steps = Point(begin, 0.0, np.inf), 0
    for nearer in _WAYS[way](energy, begin):
        steps += nearer.x is not point.x
        point = nearer
        if steps > _STALLED and way == "quasi_newton" and energy.curved:
            break
        yield point
    else:
        return
    for nearer in newton(energy, point.x):
        point = nearer
        if not point.stuck:
            yield point
    yield from _WAYS[way](energy, point.x)
