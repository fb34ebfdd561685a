"""The implicit scheme for long runs: BDF2, each step solved by a quasi-Newton iteration on a stale factor.

x = xh + b dt v, v = vh + b dt a with xh, vh and b of the two-step backward formula for uneven steps (Hairer and Wanner
II, III.5); the first step is an implicit Euler step. The formula damps what it does not resolve. What it takes follows
from forces and velocities alone and is booked as dissipated, so that the balance of energy is a check of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ..contract import Context, NotConverged
from .contact import RUBBING, contacts
from .elements import apply, elements
from .explicit import CONTACT, LOST, WORK, forces
from .hessian import Stiffness
from .moment import Reached, State, balanced, begin, copied, floor, kinetic, strength
from .newton import descend
from .params import WoodParams
from .precondition import Preconditioner, preconditioner
from .settings import Settings
from .state import Wood
from .stepping import broken

__all__ = ["implicit"]

#: Solves before a stale factor is given up, and factors before a step is.
_SOLVES, _FACTORS = 60, 5
#: A factor is renewed when it has cost this many solves more than a fresh one would have: about what a new one costs.
_EXCESS = 40
#: The least residual that is asked for: this share of the tolerance, of the load that the bundle bears.
_LEAST = 1e-4
_HALVINGS = 12
#: How far an edge's ends move against each other in one step of Newton's, over its length.
_TURN = 0.3
#: Times that breaking and solving alternate in one step.
_PASSES = 40


class _Past(NamedTuple):
    """The state one step ago, and that step [s]."""

    x: np.ndarray
    v: np.ndarray
    dt: float


class _Step(NamedTuple):
    """What a step sets out from: xh, vh (v, 3), b dt [s], its end [s]."""

    xh: np.ndarray
    vh: np.ndarray
    bdt: float
    time: float


class _Solver:
    """The iteration with its factor, over one run."""

    def __init__(self, params: WoodParams, tolerance: float) -> None:
        self.params, self.tolerance = params, tolerance
        self._factor: Preconditioner | None = None
        self._pattern: Stiffness | None = None
        self._key: tuple[int, ...] = ()
        self._bdt, self._fresh, self._excess = 0.0, 0, 0
        self.factors, self.solves = 0, 0

    def _renew(self, state: State, bdt: float) -> None:
        wood = state.wood
        m = wood.motion
        # bonds change hands and vertices are added only by breaks of rods
        key = (len(m.x), state.rods)
        pattern = self._pattern if self._key == key else None
        inertia = m.mass * (1 / bdt + self.params.damping) / bdt
        self._factor, self._pattern = preconditioner(
            m.x, wood.rods, wood.bonds, m.held == 0, inertia, contacts(state, bdt, True), pattern
        )
        self._key, self._bdt, self._fresh, self._excess = key, bdt, 0, 0
        self.factors += 1

    def forces(self, state: State, time: float, dt: float) -> np.ndarray:
        """Fill the state's forces for its x and v at `time`; return them (v, 3) [N]."""
        w = state.wood
        forces(w.motion, w.rods, w.bonds, w.turns, w.bodies, state.scratch, False, time, dt, RUBBING, state.books)
        return state.scratch.f

    def solve(self, state: State, step: _Step, guesses: tuple[np.ndarray, ...], least: float) -> tuple[float, float]:
        """Find x and v of the step in place, from the better of the guesses (v, 3); return the relative residual.

        Raises:
            NotConverged: it is not found.

        """
        wood, p = state.wood, self.params
        m = wood.motion
        held = m.held == 1
        free = ~held

        def residual(x: np.ndarray) -> np.ndarray:
            m.x[:] = x
            m.v[free] = (x[free] - step.xh[free]) / step.bdt
            f = self.forces(state, step.time, step.bdt)
            r: np.ndarray = m.mass[:, None] * ((m.v - step.vh) / step.bdt + p.damping * m.v) - f
            r[held] = 0.0
            return r

        norms = [float(np.linalg.norm(residual(x))) for x in guesses]
        x = guesses[int(np.nanargmin(norms))]
        scale = max(norms[0], _LEAST * strength(wood, p), least)
        wanted = self.tolerance * scale
        contact = 0.2 * float(wood.bodies.half[:, 0].min()) if len(wood.bodies.kind) else np.inf
        first, second = wood.rods.a, wood.rods.b
        turned = _TURN * wood.rods.rest

        def limit(way: np.ndarray) -> float:
            """Return the share of a step that turns and stretches no edge by much, and passes through no body."""
            apart = np.linalg.norm(way[second] - way[first], axis=1)
            share = 1.0 / max(float((apart / turned).max()), 1e-300)
            return min(share, contact / max(float(np.abs(way).max()), 1e-300))

        inertia = (m.mass * (1 / step.bdt + p.damping) / step.bdt)[:, None]

        def stiffness(positive: bool) -> Callable[[np.ndarray], np.ndarray]:
            parts = elements(m.x, wood.rods, wood.bonds, positive)
            touching = contacts(state, step.bdt, positive)

            def times(way: np.ndarray) -> np.ndarray:
                out: np.ndarray = inertia * way
                apply(parts, way, out)
                if touching is not None:
                    out += np.einsum("vij,vj->vi", touching, way)
                out[held] = 0.0
                return out

            return times

        root = np.arange(len(m.x))
        norm = min(norms)
        for attempt in range(_FACTORS):
            stale = self._factor is None or self._bdt != step.bdt or self._excess > _EXCESS
            if stale or attempt:
                residual(x)
                self._renew(state, step.bdt)
            assert self._factor is not None
            old = len(self._factor.free)
            while (root >= old).any():
                root = np.where(root >= old, wood.parent[root], root)
            factor = self._factor
            found = descend(residual, stiffness, x, partial(factor.solve, root=root), wanted, _SOLVES, limit)
            self.solves += found.solves
            x, norm = found.x, found.norm
            if not self._fresh:
                self._fresh = found.solves + 1
            self._excess += max(found.solves - self._fresh, 0)
            if norm <= wanted:
                residual(x)
                return norm / scale, scale
        raise NotConverged(
            f"an implicit step of {step.bdt:.2g} s at t = {step.time:.4g} s was not solved.",
            advice="Give a shorter step, or take the explicit mode.",
            residual=norm / scale,
        )


def _grown(past: np.ndarray, parent: np.ndarray) -> np.ndarray:
    """Return what new vertices had before they were split off: what the split one had."""
    while len(past) < len(parent):
        past = np.vstack([past, past[parent[len(past) :][:1]]])
    return past


def _step(
    solver: _Solver, state: State, past: _Past | None, time: float, dt: float, depth: int = 0, scale: float = 0.0
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
    power0 = _power(state, params)
    still, here, f0 = kinetic(state.wood), x0, state.scratch.f.copy()
    moved = np.where(m.held[:, None] == 1, x0 + dt * v0, x0)
    guesses: tuple[np.ndarray, ...] = (moved, x0 + dt * v0)
    to, done = _Step(xh, vh, share * dt, time + dt), 0.0
    state.scratch.lagged[:] = state.scratch.normals
    try:
        for _ in range(_PASSES):
            error, scale = solver.solve(state, to, guesses, scale)
            now = state.wood.motion
            done += _along(state, f0, now.x - here)
            found = broken(state, params, time + dt, dt) if params.fracture != "none" else state
            if found is state:
                break
            state = found
            # the force jumps where something breaks: the way is taken in pieces
            here, parent = state.wood.motion.x.copy(), state.wood.parent
            state.scratch.lagged[:] = state.scratch.normals
            f0 = solver.forces(state, time + dt, share * dt).copy()
            to = to._replace(xh=_grown(to.xh, parent), vh=_grown(to.vh, parent))
            guesses = (here,)
        else:
            error, scale = solver.solve(state, to, guesses, scale)
            done += _along(state, f0, state.wood.motion.x - here)
    except NotConverged:
        if depth == _HALVINGS:
            raise
        state, past, _ = _step(solver, kept, past, time, dt / 2, depth + 1, scale)
        return _step(solver, state, past, time + dt / 2, dt / 2, depth + 1, scale)
    power1 = _power(state, params)
    x0, v0 = (_grown(a, state.wood.parent) for a in (x0, v0))
    w = state.wood.motion
    state.books[WORK] += dt / 2 * (power0[0] + power1[0]) + float((w.load * (w.x - x0)).sum())
    lost = dt / 2 * (power0[1] + power1[1])
    state.books[LOST] += lost
    slowed = dt / 2 * (power0[2] + power1[2])
    taken = done - (kinetic(state.wood) - still) - slowed
    state.impulse[:] += dt * state.scratch.push
    state = state._replace(steps=state.steps + 1, dissipated=state.dissipated + taken)
    return state, _Past(x0, v0, dt), error


def _along(state: State, before: np.ndarray, way: np.ndarray) -> float:
    """Return the work [J] of all forces on what is free, along `way` (v, 3) [m]."""
    free = state.wood.motion.held == 0
    return 0.5 * float(((before + state.scratch.f) * way)[free].sum())


def _power(state: State, params: WoodParams) -> tuple[float, float, float]:
    """Return the power of grips and bodies, that lost by friction and damping, and by damping alone [W]."""
    m = state.wood.motion
    held = m.held == 1
    grip = -float((state.scratch.f[held] * m.v[held]).sum())
    slowed = params.damping * float((m.mass[~held, None] * m.v[~held] ** 2).sum())
    return grip + float(state.scratch.power[0]), float(state.scratch.power[1]) + slowed, slowed


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
    solver, done = _Solver(params, settings.tolerance), 0
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
            # on a factor of its own: later steps must not know of this one
            shown, _, _ = _step(_Solver(params, settings.tolerance), copied(state), past, ahead * dt, rest)
        yield balanced(copied(shown), wanted, start, floor(wood, params), balance)
