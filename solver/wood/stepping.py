"""March the explicit scheme through the wanted times, breaking what is overstressed on the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..contract import Context, Unstable
from .bundle import Wood, scratch_for
from .explicit import BENDING, BONDS, CONTACT, LOST, STRETCH, WORK, Scratch, forces, march
from .fracture import break_worst, overstress
from .params import WoodParams

__all__ = [
    "Reached",
    "State",
    "balanced",
    "begin",
    "broken",
    "copied",
    "explicit",
    "floor",
    "kinetic",
    "reached",
    "strength",
]

#: Steps between looks for breaks, so many that they cost little and a wave passes few edges meanwhile.
_LOOK, _FEWEST, _MOST = 6000, 4, 32
#: Seconds of wall time between looks at the context, about, as steps times vertices.
_BATCH = 500_000


#: Kinetic, elastic, lost, work, dissipated and at the start [J].
Energy = tuple[float, float, float, float, float, float]


class State(NamedTuple):
    """A moment of a run. books (6,) [J] as `explicit` numbers them; impulse (r, 3) [N s]; steps taken.

    dissipated [J]: what an implicit scheme takes on its own account.
    """

    wood: Wood
    scratch: Scratch
    books: np.ndarray
    impulse: np.ndarray
    rods: int
    bonds: int
    steps: int
    dissipated: float = 0.0


class Reached(NamedTuple):
    """What is reported of a stage.

    energy: (kinetic, elastic, lost, work, dissipated, start) [J]; error: of what ended it.
    """

    time: float
    state: State
    energy: Energy
    error: float
    sound: bool


def kinetic(wood: Wood) -> float:
    """Return the kinetic energy [J] of what is not held, spinning about the rods' axes included."""
    m = wood.motion
    free = m.held == 0
    spin = 0.5 * float((wood.turns.inertia * m.spin**2).sum()) if wood.turning else 0.0
    return 0.5 * float((m.mass[free, None] * m.v[free] ** 2).sum()) + spin


def floor(wood: Wood, params: WoodParams) -> float:
    """Return a small energy [J] below which nothing counts: a billionth of what the rods bear before they break."""
    return 0.5e-9 * float(wood.rods.k @ wood.rods.rest) * params.strain_limit**2


def strength(wood: Wood, params: WoodParams) -> float:
    """Return the load [N] that the bundle bears by its mean section and strain limit."""
    return float(wood.rods.k @ wood.rods.rest) * params.strain_limit / params.length


def reached(time: float, state: State, start: float, error: float, sound: bool) -> Reached:
    """Return what is reported of a stage that was solved rather than marched to."""
    elastic, lost, work = float(state.books[: CONTACT + 1].sum()), float(state.books[LOST]), float(state.books[WORK])
    return Reached(time, state, (kinetic(state.wood), elastic, lost, work, 0.0, start), error, sound)


def begin(wood: Wood) -> State:
    """Return the state at time 0, forces known."""
    scratch = scratch_for(wood)
    books = np.zeros(6)
    forces(wood.motion, wood.rods, wood.bonds, wood.turns, wood.bodies, scratch, wood.turning, 0.0, 1e-9, 0.0, books)
    return State(wood, scratch, books, np.zeros((len(wood.bodies.kind), 3)), 0, 0, 0)


def broken(state: State, params: WoodParams, time: float, dt: float) -> State:
    """Return the state after one pass of breaking at `time`; what the breaks release is booked as lost."""
    wood, scratch = state.wood, state.scratch
    ratio, place = np.zeros(len(wood.rods.a)), np.zeros(len(wood.rods.a))
    m = wood.motion
    anywhere = params.fracture == "stress"
    top = overstress(
        wood.rods,
        scratch.t,
        scratch.inverse,
        wood.strength,
        m.theta,
        m.reference,
        wood.turning,
        anywhere,
        ratio,
        place,
    )
    if top <= 1 and not (scratch.each > wood.bonds.limit).any():
        return state
    before = state.books[: CONTACT + 1].sum()
    allowed = params.cascade * float(state.books[[STRETCH, BENDING, BONDS]].sum())
    wood, rods, bonds = break_worst(wood, ratio, place, scratch.each, allowed)
    scratch = scratch_for(wood)
    books = state.books
    forces(wood.motion, wood.rods, wood.bonds, wood.turns, wood.bodies, scratch, wood.turning, time, dt, 0.0, books)
    books[LOST] += before - books[: CONTACT + 1].sum()
    return state._replace(wood=wood, scratch=scratch, rods=state.rods + rods, bonds=state.bonds + bonds)


def _advance(state: State, params: WoodParams, time: float, dt: float, steps: int) -> State:
    """Return the state `steps` later.

    Raises:
        Unstable: it is no longer finite.

    """
    w = state.wood
    fine = march(
        w.motion,
        w.rods,
        w.bonds,
        w.turns,
        w.bodies,
        state.scratch,
        w.turning,
        time,
        dt,
        steps,
        params.damping,
        state.books,
        state.impulse,
    )
    if not fine:
        raise Unstable(
            f"the rods blew up before t = {time + steps * dt:.4g} s.",
            advice="Give a shorter step, a lower contact_stiffness, or slower bodies.",
        )
    return state._replace(steps=state.steps + steps)


def copied(state: State) -> State:
    """Return a state that can be stepped without touching this one."""
    wood = state.wood.copied()
    return state._replace(
        wood=wood,
        scratch=Scratch(*(a.copy() for a in state.scratch)),
        books=state.books.copy(),
        impulse=state.impulse.copy(),
    )


def explicit(
    wood: Wood, params: WoodParams, times: Sequence[float], dt: float, tolerance: float, context: Context
) -> Iterator[Reached]:
    """Yield the state at each wanted time [s]; what is between does not depend on which times are wanted.

    Raises:
        Unstable: positions are no longer finite, or the energy balance is lost.
        Cancelled: the observer asked to stop.

    """
    state = begin(wood)
    start = kinetic(wood) + float(state.books[: CONTACT + 1].sum())
    look = int(np.clip(_LOOK // len(wood.rods.a), _FEWEST, _MOST))
    breaking = params.fracture != "none"
    chunk = look if breaking else max(_BATCH // len(wood.motion.x) // look, 1) * look
    scale, since = floor(wood, params), 0
    for wanted in times:
        ahead = int(np.floor(wanted / dt * (1 + 1e-12)))
        while state.steps + look <= ahead:
            steps = min(chunk, (ahead - state.steps) // look * look)
            time = state.steps * dt
            state = _advance(state, params, time, dt, steps)
            if breaking:
                state = broken(state, params, time + steps * dt, dt)
            since += steps * len(wood.motion.x)
            if since > _BATCH:
                since = 0
                context.check_cancelled()
                found = balanced(state, state.steps * dt, start, scale, tolerance)
                scale = _scale(found.energy, scale)
                context.report(state.steps * dt / times[-1], f"t = {state.steps * dt:.4g} s")
        shown = copied(state)
        rest = ahead - state.steps
        if rest:
            shown = _advance(shown, params, state.steps * dt, dt, rest)
        if wanted - ahead * dt > 1e-9 * dt:
            shown = _advance(shown, params, ahead * dt, wanted - ahead * dt, 1)
        yield balanced(shown, wanted, start, scale, tolerance)


def _scale(energy: Energy, scale: float) -> float:
    kinetic_, elastic, lost, work, dissipated, start = energy
    return max(scale, start, abs(work), kinetic_ + elastic + abs(lost) + abs(dissipated))


def balanced(state: State, time: float, start: float, scale: float, tolerance: float) -> Reached:
    """Return the stage with its balance; a balance lost altogether is a run that blew up.

    Raises:
        Unstable: see above.

    """
    elastic = float(state.books[: CONTACT + 1].sum())
    moving = kinetic(state.wood)
    energy = (moving, elastic, float(state.books[LOST]), float(state.books[WORK]), state.dissipated, start)
    error = abs(moving + elastic + energy[2] + energy[4] - energy[3] - start) / _scale(energy, scale)
    if error > 0.5:
        raise Unstable(
            f"at t = {time:.4g} s the energy balance is off by {100 * error:.0f} percent.",
            advice="Give a shorter step, or a lower contact_stiffness.",
        )
    return Reached(time, state, energy, error, error <= tolerance)
