"""The implicit scheme for long runs: BDF2, each step solved by a quasi-Newton iteration on a stale factor.

x = xh + b dt v, v = vh + b dt a with xh, vh and b of the two-step backward formula for uneven steps (Hairer and Wanner
II, III.5); the first step is an implicit Euler step. The formula damps what it does not resolve. What it takes follows
from forces and velocities alone and is booked as dissipated, so that the balance of energy is a check of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...contract import Context, NotConverged
from ..contact.listing import Listing
from ..model.state import Wood
from ..params import WoodParams
from ..settings import Settings
from .equations import Step, filled
from .explicit import CONTACT, LOST, WORK
from .marching import broken
from .moment import Reached, State, balanced, begin, copied, floor, kinetic
from .solving import Solver

__all__ = ["implicit"]

_HALVINGS = 12
#: Times that breaking and solving alternate in one step.
_PASSES = 60
#: What a pass may release over what an explicit one may: it stands for the many that the load takes to find a new way.
_AT_ONCE = 5.0
#: The residual that a solve between two breaks may leave, over that of a step's last.
_ROUGH = 10.0
#: Error of the work of a step, over the elastic energy or itself, and how often its trapezia are halved.
_SMALL, _LEVELS = 1e-3, 6


class _Past(NamedTuple):
    """The state one step ago, and that step [s]."""

    x: np.ndarray
    v: np.ndarray
    dt: float


def _grown(past: np.ndarray, parent: np.ndarray) -> np.ndarray:
    """Return what new vertices had before they were split off: what the split one had."""
    while len(past) < len(parent):
        past = np.vstack([past, past[parent[len(past) :][:1]]])
    return past


def _step(
    solver: Solver, state: State, past: _Past | None, time: float, dt: float, depth: int = 0, scale: float = 0.0
) -> tuple[State, _Past, float]:
    """Return the state a step later, its past, and the residual; halves the step where it is not solved.

    Raises:
        NotConverged: not even after `_HALVINGS` halvings.

    """
    params = solver.params
    m = state.wood.motion
    # breaks change arrays in place: what a shorter step sets out from is kept
    kept = copied(state)
    x0, v0 = kept.wood.motion.x, kept.wood.motion.v
    if past is None:
        xh, vh, share = x0, v0, 1.0
    else:
        ratio = dt / past.dt
        one, two = (1 + ratio) ** 2 / (1 + 2 * ratio), ratio**2 / (1 + 2 * ratio)
        share = (1 + ratio) / (1 + 2 * ratio)
        xh, vh = one * x0 - two * past.x, one * v0 - two * past.v
    before = _power(state, params)
    still, here, v_here, f0 = kinetic(state.wood), x0, v0, state.scratch.f.copy()
    moved = np.where(m.held[:, None] == 1, x0 + dt * v0, x0)
    guesses: tuple[np.ndarray, ...] = (moved, x0 + dt * v0)
    to, done = Step(xh, vh, share * dt, time + dt), 0.0
    solver.lag(state)
    rough, pushed = 1.0, 0.0
    try:
        for count in range(_PASSES + 1):
            error, scale = solver.solve(state, to, guesses, scale, rough if count < _PASSES else 1.0)
            state = solver.listing.fitted(state)
            span = (time + dt if count else time, time + dt)
            along, given = _along(solver.listing, state, (here, v_here, f0), span, to.bdt)
            done, pushed = done + along, pushed + given
            found = state
            if params.fracture != "none" and count < _PASSES:
                found = broken(state, params, time + dt, dt, _AT_ONCE)
            if found is state and (rough == 1 or count == _PASSES):
                break
            rough = 1.0 if found is state else _ROUGH
            # the force jumps where something breaks: the way is taken in pieces
            state = found
            here, v_here, parent = state.wood.motion.x.copy(), state.wood.motion.v.copy(), state.wood.parent
            f0 = solver.again(state, time + dt, share * dt)
            to = to._replace(xh=_grown(to.xh, parent), vh=_grown(to.vh, parent))
            guesses = (here,)
    except NotConverged:
        if depth == _HALVINGS:
            raise
        state, past, _ = _step(solver, kept, past, time, dt / 2, depth + 1, scale)
        return _step(solver, state, past, time + dt / 2, dt / 2, depth + 1, scale)
    rubbed, damped = ((a + b) * dt / 2 for a, b in zip(before, _power(state, params), strict=True))
    x0, v0 = (_grown(a, state.wood.parent) for a in (x0, v0))
    w = state.wood.motion
    state.books[WORK] += pushed + float((w.load * (w.x - x0)).sum())
    state.books[LOST] += rubbed + damped
    taken = done - (kinetic(state.wood) - still) - damped
    state.impulse[:] += dt * state.scratch.push
    state = state._replace(steps=state.steps + 1, dissipated=state.dissipated + taken)
    return state, _Past(x0, v0, dt), error


def _along(
    listing: Listing,
    state: State,
    start: tuple[np.ndarray, np.ndarray, np.ndarray],
    times: tuple[float, float],
    bdt: float,
) -> tuple[float, float]:
    """Return the work [J] of all forces on what is free, and that of grips and bodies, straight to the state.

    start: x, v (v, 3) and the forces there [N]; times: of start and end [s]. By Romberg's rule, as what snaps turns far
    in one step; the sums are the trapezia's and their halvings'.
    """
    m, scratch = state.wood.motion, state.scratch
    free = m.held == 0
    end = m.x.copy(), m.v.copy()
    way, span = (end[0] - start[0])[free], times[1] - times[0]

    def both(f: np.ndarray) -> np.ndarray:
        grip = -float((f[~free] * m.v[~free]).sum())
        return np.array([float((f[free] * way).sum()), span * (grip + float(scratch.power[0]))])

    def at(s: float) -> np.ndarray:
        m.x[:] = start[0] + s * (end[0] - start[0])
        m.v[:] = start[1] + s * (end[1] - start[1])
        return both(filled(state, times[0] + s * span, bdt, listing))

    last = both(scratch.f)
    m.v[:] = start[1]
    first = at(0.0)
    first[0] = float((start[2][free] * way).sum())
    small = _SMALL * float(state.books[: CONTACT + 1].sum())
    rule, fine = 0.5 * (first + last), np.full(2, np.inf)
    for level in range(1, _LEVELS + 1):
        count = 2**level
        middle = sum((at((2 * n + 1) / count) for n in range(count // 2)), np.zeros(2))
        rule, coarse, once = 0.5 * rule + middle / count, rule, fine
        fine = (4 * rule - coarse) / 3
        near = coarse if level == 1 else once
        if float(np.abs(fine - near).max()) <= max(small, _SMALL * float(np.abs(fine).max())):
            break
    m.x[:], m.v[:] = end
    filled(state, times[1], bdt, listing)
    return float(fine[0]), float(fine[1])


def _power(state: State, params: WoodParams) -> tuple[float, float]:
    """Return the power that friction and damping take [W]."""
    m = state.wood.motion
    free = m.held == 0
    return float(state.scratch.power[1]), params.damping * float((m.mass[free, None] * m.v[free] ** 2).sum())


def implicit(
    wood: Wood, params: WoodParams, times: Sequence[float], settings: Settings, balance: float, context: Context
) -> Iterator[Reached]:
    """Yield the state at each wanted time [s]; it is sound if no more than `balance` of its energy is missing.

    Raises:
        NotConverged: a step was not solved, however short.
        Cancelled: the observer asked to stop.

    """
    state, past, dt = begin(wood), None, settings.step
    start = kinetic(wood) + float(state.books[: CONTACT + 1].sum())
    solver, done = Solver(params, settings.tolerance, Listing(wood, params)), 0
    for wanted in times:
        ahead = int(np.floor(wanted / dt * (1 + 1e-12)))
        while done < ahead:
            context.check_cancelled()
            state, past, _ = _step(solver, state, past, done * dt, dt)
            done += 1
            context.report(done * dt / times[-1], f"t = {done * dt:.4g} s")
        shown = state
        rest = wanted - ahead * dt
        if rest > 1e-9 * dt:
            # later steps must not know of this one
            shown, _, _ = _step(solver.twin(), copied(state), past, ahead * dt, rest)
        yield balanced(copied(shown), wanted, start, floor(wood, params), balance)
