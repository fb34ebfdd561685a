"""March the explicit scheme through the wanted times, breaking what is overstressed on the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...contract import Context, InvalidGeometry, Unstable
from ..cohesion import soften
from ..contact.bodies import deepest
from ..contact.listing import Listing
from ..crushing import crush
from ..fracture import break_worst, strained
from ..model.motion import BENDING, BONDS, CONTACT, LOST, STRETCH
from ..model.state import State, Wood, copied, scratch_for
from ..params import WoodParams
from .explicit import forces, march
from .gripping import steer, take
from .moment import Reached, balanced, begin, floor, largest, real
from .pacing import Pace

__all__ = ["broken", "explicit", "pressed"]

#: Steps between looks for breaks, so many that they cost little and a wave passes few edges meanwhile.
_LOOK, _FEWEST, _MOST = 6000, 4, 32
#: Seconds of wall time between looks at the context, about, as steps times vertices.
_BATCH = 500_000
#: Of the bound of strain over strength, below which nothing breaks: it is rounded otherwise than what it bounds.
_BELOW = 0.999


def broken(state: State, params: WoodParams, time: float, dt: float) -> State:
    """Return the state after one pass of breaking at `time`; what the breaks release is booked as lost."""
    wood, scratch = state.wood, state.scratch
    anywhere = params.fracture == "stress"
    taken, parted, gone = soften(scratch.plan, wood.bonds, scratch.each, params.mixing)
    # most looks find nothing: a bound says so for less
    bound = float(scratch.found[:, 3].max()) if anywhere and not wood.turning else 1.0
    top, ratio, place = strained(wood, scratch, anywhere) if bound >= _BELOW else (0.0, np.zeros(0), np.zeros(0))
    if top <= 1 and not (parted or gone):
        # the next half step is still taken with the forces of what is damaged now
        state.books[BONDS] -= taken
        state.books[LOST] += taken
        return state._replace(spent=state.spent + taken) if taken else state
    before = state.books[: CONTACT + 1].sum() + real(state)
    allowed = params.cascade * float(state.books[[STRETCH, BENDING, BONDS]].sum())
    rods = bonds = 0
    if top > 1:
        wood, rods, bonds = break_worst(wood, ratio, place, allowed)
    # damage stood in the plan already; what falls apart needs another, and other fragments
    scratch = scratch_for(wood)._replace(rubbing=state.scratch.rubbing)
    books = state.books
    forces(wood.motion, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, time, dt, books)
    found = state._replace(wood=wood, scratch=scratch, rods=state.rods + rods, bonds=state.bonds + bonds + parted)
    # what fragments that come off no longer have by their scaled mass is lost, too
    released = float(before - books[: CONTACT + 1].sum() - real(found))
    books[LOST] += released
    return found._replace(spent=state.spent + released)


def pressed(state: State, params: WoodParams, time: float, dt: float) -> State:
    """Return the state with what is pressed too hard crushed; what this takes is booked as lost."""
    wood, scratch, books = state.wood, state.scratch, state.books
    if not crush(scratch.plan, wood.rods, scratch.inverse, params.crush_strain):
        return state
    before = float(books[: CONTACT + 1].sum())
    forces(wood.motion, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, time, dt, books)
    taken = before - float(books[: CONTACT + 1].sum())
    books[LOST] += taken
    return state._replace(crushed=state.crushed + taken)


def _advance(state: State, params: WoodParams, time: float, dt: float, steps: int) -> State:
    """Return the state `steps` later.

    Raises:
        Unstable: it is no longer finite.

    """
    w = state.wood
    steer(state, time, steps * dt)
    fine = march(
        w.motion,
        w.rods,
        w.turns,
        w.bodies,
        w.pins,
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
    take(state, time + steps * dt)
    return state._replace(steps=state.steps + steps)


def _refreshed(listing: Listing, state: State, ahead: float, time: float, dt: float) -> State:
    """Return the state with pairs that hold for `ahead` [s] from `time` [s], its energies booked.

    What rods that touch at the start have is booked as taken from what is lost.
    """
    fitted = listing.fitted(state, ahead)
    if fitted is state:
        return state
    w, before = state.wood, float(state.books[: CONTACT + 1].sum())
    forces(w.motion, w.rods, w.turns, w.bodies, fitted.scratch, w.turning, time, dt, state.books)
    state.books[LOST] += before - float(state.books[: CONTACT + 1].sum())
    return fitted


def _clear(state: State) -> None:
    """Refuse bodies that begin in the wood: contact's penalty would throw both apart with an energy out of nothing.

    Raises:
        InvalidGeometry: see above.

    """
    wood, depth = state.wood, np.zeros(len(state.wood.bodies.kind))
    deepest(wood.motion.x, wood.rods, wood.bodies, state.scratch.poses, depth)
    # what lies against the wood covers the axes of its outer rods by less than one radius
    most = float(wood.rods.radius.max())
    for r in np.flatnonzero(depth > most):
        raise InvalidGeometry(
            f"body {r} begins in the wood: a rod's axis is {1e3 * depth[r]:.3g} mm deep in it.",
            advice="Let it begin beside the wood, and move or fly into it.",
        )


def explicit(
    wood: Wood,
    params: WoodParams,
    times: Sequence[float],
    dt: float,
    tolerance: float,
    context: Context,
    courant: float = np.inf,
) -> Iterator[Reached]:
    """Yield the state at each wanted time [s]; what is between does not depend on which times are wanted.

    dt [s]: step at the start; courant: the most that it may be of the longest stable one once something broke.

    Raises:
        InvalidGeometry: a body begins in the wood.
        Unstable: positions are no longer finite, or the energy balance is lost.
        Cancelled: the observer asked to stop.

    """
    state = begin(wood)
    _clear(state)
    start = real(state) + float(state.books[: CONTACT + 1].sum())
    breaking, crushing = params.fracture != "none", params.compressive_strength is not None
    # scaled masses follow what touches, at times that do not depend on which are wanted
    often = breaking or crushing or params.touching or bool(wood.grips) or wood.scaling > 1
    # a branch that slips out of a press is past it in a few steps: seldom looked at, 15 % of its energy were not booked
    look = int(np.clip(_LOOK // len(wood.rods.a), _FEWEST, _MOST)) if often else _MOST
    chunk = look if often else max(_BATCH // len(wood.motion.x) // look, 1) * look
    scale, since, listing, pace = floor(wood, params), 0, Listing(wood, params), Pace(state, params, dt, courant)
    for wanted in times:
        while state.steps + look <= (ahead := pace.within(wanted)):
            steps = min(chunk, (ahead - state.steps) // look * look)
            time, dt = pace.at(state.steps), pace.dt
            state = _refreshed(listing, state, steps * dt, time, dt)
            state = _advance(state, params, time, dt, steps)
            if crushing:
                state = pressed(state, params, time + steps * dt, dt)
            if breaking:
                state = broken(state, params, time + steps * dt, dt)
                pace.fit(state)
            since += steps * len(wood.motion.x)
            if since > _BATCH:
                since = 0
                context.check_cancelled()
                found = balanced(state, pace.at(state.steps), start, scale, tolerance)
                scale = largest(found.energy, scale)
                context.report(pace.at(state.steps) / times[-1], f"t = {pace.at(state.steps):.4g} s")
        time, dt, rest = pace.at(state.steps), pace.dt, ahead - state.steps
        state = _refreshed(listing, state, look * dt, time, dt)
        shown = copied(state)
        if rest:
            shown = _advance(shown, params, time, dt, rest)
            time = pace.at(ahead)
        if wanted - time > 1e-9 * dt:
            shown = _advance(shown, params, time, wanted - time, 1)
        yield balanced(shown, wanted, start, scale, tolerance)
