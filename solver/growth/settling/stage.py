"""A stage that is handed over: settled further than the way to it needs, against forces that bend it.

On its way a run may be as far out of balance as growth moves it anyway. What is handed over is held to a force that a
thin sheet feels: a fold by one radian exerts D / l, which is less than the membrane's mu l by (t / l)^2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ... import shell
from ...arrays import Floats
from ...contract import Unstable
from ..matter import softer
from ..params import GrowthParams
from ..solids import present
from ..state import State
from .energy import StepEnergy
from .minimise import Point, longest, quasi_newton
from .newton import ASIDE, bending, newton
from .nudges import across
from .tangent import Tangent

__all__ = ["force_unit", "residual", "settled"]

#: How far Newton's last step may have moved a vertex, over the mean rest edge: a soft shape swings far on small forces.
_NEAR = 3e-6
#: Times that pressure is laid along the present normals, and steps to an equilibrium after each.
_TURNS, _MOST = 30, 400
#: What is left after a turn, over what was before, above which the next goes half as far to new loads; the least share.
_NEARER, _LEAST_SHARE = 0.7, 0.02


def force_unit(state: State, material: shell.Material) -> float:
    """Return the force that residuals are measured in [mu l]: the lesser of a stretched edge's and a folded one's."""
    return state.length * softer(state, material.flexural)


def residual(state: State, params: GrowthParams) -> float:
    """Return the largest force of a state over `force_unit`."""
    return state.forces * state.length / force_unit(state, shell.Material(params.thickness, params.poisson))


def settled(state: State, params: GrowthParams, tolerance: float, distance: float) -> Iterator[State]:
    """Settle a state until no force is above tolerance x `force_unit`, or as far as it goes; yields on the way.

    And until nothing moves any more: Newton's own step, which is the distance that is left, is below 0.03 % of an edge,
    and the energy bends up along every way. A shape in balance on a saddle is nudged off it.
    Pressure follows the normals, which were frozen on the way here: within each step where the surface is closed, else
    it is laid again until nothing changes, and so is what compression pushes. The last value is the result, `forces` of
    which is what is left, and `minimum` whether it is one. distance: that parts keep from each other, 0 where none come
    near.

    Raises:
        Unstable: the shape left the finite.

    """
    material = shell.Material(params.thickness, params.poisson)
    energy = StepEnergy(
        state,
        material,
        params.pressure,
        present(params.solids, state.time),
        Tangent(state.mesh),
        params.gravity,
        distance,
        params.bending,
        following=params.bending == "hinges",
        pushing=params.normal_force,
    )
    goal = tolerance * force_unit(state, material)
    way = _rested if energy.curved else _balanced
    laid = bool(params.normal_force or (params.pressure and not energy.following))
    x, steps, share, before = state.x, 0, 1.0, np.inf
    for turn in range(_TURNS):
        for found in way(energy, x, goal, params.seed):
            if not np.isfinite(found.point.gradient):
                raise Unstable("the shape left the finite.", advice="Take a shorter step.", last_stage=state.time)
            yield replace(state, x=found.point.x)
        x, steps = found.point.x, steps + found.steps
        was = energy.pushed
        energy.follow(x)
        left = _measured(energy, replace(state, x=x))
        if left <= goal or not laid or turn == _TURNS - 1:
            break
        if params.normal_force:
            # what compression pushes takes it away: all at once it would swing to and fro
            share = share if left < _NEARER * before else max(share / 2, _LEAST_SHARE)
            before = left
            energy.lay(was, share)
    iterations = state.iterations + steps
    yield replace(state, x=x, forces=left / state.length, iterations=iterations, minimum=found.minimum)


class _Found(NamedTuple):
    """A point on the way down, steps so far, and whether it is shown to be a minimum."""

    point: Point
    steps: int
    minimum: bool


def _rested(energy: StepEnergy, x: Floats, goal: float, seed: int) -> Iterator[_Found]:
    """Go down from x (n, 3) by Newton's method; yields after each step."""
    near, steps, again = _NEAR * energy.state.length, 0, True
    start = across(energy, x, seed)
    while again and steps < _MOST:
        last = x
        for point in newton(energy, x):
            moved = longest(point.x - last)
            steps += point.x is not last
            least = point.gradient <= goal and point.left <= near
            yield _Found(point, steps, least)
            # a shifted step may be short on a saddle, and elsewhere
            short = point.gradient <= goal and point.left == np.inf and point.x is not last and moved <= near
            last = point.x
            if least or short or point.stuck or steps >= _MOST or not np.isfinite(point.gradient):
                break
        if least or not np.isfinite(point.gradient):
            return
        bends, x = bending(energy, point.x, start, ASIDE * energy.state.length)
        steps += bends == "down"
        again = bends == "down" or (bends == "up" and not point.stuck)
        yield _Found(point, steps, not again)


def _balanced(energy: StepEnergy, x: Floats, goal: float, _seed: int) -> Iterator[_Found]:
    """Go down from x (n, 3) where there are no second derivatives: that nothing pushes is all that is asked for."""
    steps, last = 0, x
    for point in quasi_newton(energy, x):
        steps += point.x is not last
        last = point.x
        yield _Found(point, steps, True)
        if point.gradient <= goal or point.stuck or steps >= _MOST:
            return


def _measured(energy: StepEnergy, state: State) -> float:
    return longest(energy(state.x)[1])
