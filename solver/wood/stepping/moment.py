"""A moment of a run, and what is reported of a stage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...contract import Unstable
from ..model.motion import CONTACT, LOST, WORK
from ..model.state import State, Wood, scratch_for
from ..params import WoodParams
from .explicit import forces
from .flying import moving
from .scaling import saved

__all__ = [
    "Energy",
    "Reached",
    "balanced",
    "begin",
    "floor",
    "kinetic",
    "largest",
    "reached",
    "real",
    "strength",
]

#: Kinetic, elastic, lost, work and at the start [J].
Energy = tuple[float, float, float, float, float]


class Reached(NamedTuple):
    """What is reported of a stage.

    energy: (kinetic, elastic, lost, work, start) [J]; error: of what ended it.
    """

    time: float
    state: State
    energy: Energy
    error: float
    sound: bool


def kinetic(wood: Wood) -> float:
    """Return the kinetic energy [J] of what is not held, spinning about the rods' axes and flying bodies included."""
    m = wood.motion
    free = m.held == 0
    spin = 0.5 * float((wood.turns.inertia * m.spin**2).sum()) if wood.turning else 0.0
    return 0.5 * float((m.mass[free, None] * m.v[free] ** 2).sum()) + spin + moving(wood.bodies)


def real(state: State) -> float:
    """Return the energy of motion [J], that of fragments as a whole by their real mass."""
    m = state.wood.motion
    return kinetic(state.wood) - saved(m.x, m.v, m.mass, state.scratch.fragments)


def floor(wood: Wood, params: WoodParams) -> float:
    """Return a small energy [J] below which nothing counts: a billionth of what the rods bear before they break."""
    return 0.5e-9 * float(wood.rods.k @ wood.rods.rest) * params.strain_limit**2


def strength(wood: Wood, params: WoodParams) -> float:
    """Return the load [N] that the bundle bears by its mean section and strain limit."""
    return float(wood.rods.k @ wood.rods.rest) * params.strain_limit / params.length


def reached(time: float, state: State, start: float, error: float) -> Reached:
    """Return what is reported of a stage that was solved rather than marched to."""
    elastic, lost, work = float(state.books[: CONTACT + 1].sum()), float(state.books[LOST]), float(state.books[WORK])
    return Reached(time, state, (kinetic(state.wood), elastic, lost, work, start), error, True)


def begin(wood: Wood) -> State:
    """Return the state at time 0, forces known."""
    scratch = scratch_for(wood)
    books = np.zeros(6)
    forces(wood.motion, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, 0.0, 1e-9, books)
    return State(
        wood, scratch, books, np.zeros((len(wood.bodies.kind), 6)), np.zeros((len(wood.grips), 6)), 0.0, 0, 0, 0
    )


def largest(energy: Energy, scale: float) -> float:
    """Return the largest energy [J] of a run so far: what errors of the balance are held against."""
    kinetic_, elastic, lost, work, start = energy
    return max(scale, start, abs(work), kinetic_ + elastic + abs(lost))


def balanced(state: State, time: float, start: float, scale: float, tolerance: float) -> Reached:
    """Return the stage with its balance; a balance lost altogether is a run that blew up.

    Raises:
        Unstable: see above.

    """
    elastic = float(state.books[: CONTACT + 1].sum())
    moving = real(state)
    energy = (moving, elastic, float(state.books[LOST]), float(state.books[WORK]), start)
    error = abs(moving + elastic + energy[2] - energy[3] - start) / largest(energy, scale)
    # what is not finite is not less, either
    if not error <= 0.5:
        lost = f"the energy balance is off by {100 * error:.0f} percent" if error > 0.5 else "energies are not finite"
        raise Unstable(
            f"at t = {time:.4g} s {lost}.",
            advice=_advice(state),
        )
    return Reached(time, state, energy, error, error <= tolerance)


def _advice(state: State) -> str:
    """Return what may help, of what is there."""
    wood = state.wood
    found = ["a shorter step"]
    found += ["a lower contact_stiffness, slower bodies"] if len(wood.bodies.kind) else []
    found += ["slower grips"] if wood.grips else []
    found += ["less mass_scaling"] if wood.scaling > 1 else []
    found += ["smaller loads"] if np.any(wood.motion.load) else []
    return f"Give {', or '.join(found)}."
