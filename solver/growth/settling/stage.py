"""A stage that is handed over: settled further than the way to it needs, against forces that bend it.

On its way a run may be as far out of balance as growth moves it anyway. What is handed over is held to a force that a
thin sheet feels: a fold by one radian exerts D / l, which is less than the membrane's mu l by (t / l)^2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ... import shell
from ...contract import Unstable
from ..params import GrowthParams, present
from ..state import State
from .energy import StepEnergy
from .minimise import Point, quasi_newton
from .newton import newton
from .tangent import Tangent

__all__ = ["force_unit", "residual", "settled"]

#: How far Newton's last step may have moved a vertex, over the mean rest edge: a soft shape swings far on small forces.
_NEAR = 0.003
#: Times that pressure is laid along the present normals, and steps to an equilibrium after each.
_TURNS, _MOST = 30, 400


def force_unit(state: State, material: shell.Material) -> float:
    """Return the force that residuals are measured in [mu l]: the lesser of a stretched edge's and a folded one's."""
    return state.length * min(1.0, material.flexural / state.length**2)


def residual(state: State, params: GrowthParams) -> float:
    """Return the largest force of a state over `force_unit`."""
    return state.forces * state.length / force_unit(state, shell.Material(params.thickness, params.poisson))


def settled(state: State, params: GrowthParams, tolerance: float, distance: float) -> Iterator[State]:
    """Settle a state until no force is above tolerance x `force_unit`, or as far as it goes; yields after each step.

    And until nothing moves any more: Newton's last step, which is the distance that is left, is below 0.3 % of an edge.
    Pressure follows the normals, which were frozen on the way here: within each step where the surface is closed, else
    it is laid again until nothing changes. The last value is the result, `forces` of which is what is left.
    distance: that parts keep from each other, 0 where none come near.

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
    )
    goal = tolerance * force_unit(state, material)
    way = newton if energy.curved else quasi_newton
    near = _NEAR * state.length if energy.curved else np.inf
    point, steps = Point(state.x, *_measured(energy, state)), 0
    for _ in range(_TURNS):
        for count, nearer in enumerate(way(energy, point.x)):
            moved = float(np.abs(nearer.x - point.x).max()) if count else np.inf
            steps += nearer.x is not point.x
            point = nearer
            if not np.isfinite(point.gradient):
                raise Unstable("the shape left the finite.", advice="Take a shorter step.", last_stage=state.time)
            if (point.gradient <= goal and moved <= near) or point.stuck or count >= _MOST:
                break
            yield state
        energy.follow(point.x)
        left = _measured(energy, replace(state, x=point.x))[1]
        if left <= goal or energy.following or not params.pressure:
            break
    iterations = state.iterations + steps
    yield replace(state, x=point.x, forces=left / state.length, iterations=iterations)


def _measured(energy: StepEnergy, state: State) -> tuple[float, float]:
    value, gradient = energy(state.x)
    return value, float(np.abs(gradient).max())
