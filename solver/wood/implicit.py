"""The implicit scheme for long runs (BDF2), and equilibria under loads that grow (static).

x = xh + b dt v, v = vh + b dt a with xh, vh and b of the two-step backward formula for uneven steps (Hairer and Wanner
II, III.5); the first step is an implicit Euler step. Newton's method keeps its factor as long as it converges fast.
The formula damps what it does not resolve; how much that takes is reported as missing energy.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import splu

from ..contract import Context, NotConverged
from .bodies import press
from .bundle import Wood
from .explicit import CONTACT, LOST, WORK, forces
from .hessian import Stiffness
from .params import WoodParams
from .stepping import Reached, State, begin, broken, copied, floor, kinetic

__all__ = ["equilibrium", "implicit", "static"]

_TOLERANCE = 1e-6
_ITERATIONS = 60
#: A factor is renewed when an iteration leaves more of the residual than this.
_SLOW = 0.3
_HALVINGS = 12
#: Times that breaking and solving alternate in one step.
_PASSES = 30
#: Slip at which friction has its full size [m/s].
_RUBBING = 1e-3


class _Past(NamedTuple):
    """The state one step ago, and that step [s]; None at the start."""

    x: np.ndarray
    v: np.ndarray
    dt: float


class _Solver:
    """Newton's method with a stale factor over one run."""

    def __init__(self, params: WoodParams) -> None:
        self._params = params
        self._stiffness: Stiffness | None = None
        self._lu: Any = None
        self._key: tuple[object, ...] = ()
        self.factors = 0

    def _factor(self, state: State, inertia: float, dt: float) -> None:
        wood = state.wood
        m = wood.motion
        # bonds change hands and vertices are added only by breaks of rods
        key = (len(m.x), state.rods)
        if self._stiffness is None or self._key != key:
            self._stiffness = Stiffness(wood.rods, wood.bonds, m.held == 0)
            self._key = key
        free = m.held == 0
        # what a lone vertex without any stiffness has in equilibria
        diagonal = np.repeat(m.mass[free] * inertia, 3)
        blocks = self._contacts(state, dt) if len(wood.bodies.kind) else None
        matrix = self._stiffness.matrix(m.x, wood.rods, wood.bonds, diagonal, blocks)
        self._lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        self.factors += 1

    def _contacts(self, state: State, dt: float) -> np.ndarray:
        """Return the stiffness of contacts (free vertices, 3, 3): along the normal, and what friction resists."""
        wood, s = state.wood, state.scratch
        m, free = wood.motion, state.wood.motion.held == 0
        out = np.zeros((int(free.sum()), 3, 3))
        for r in range(len(wood.bodies.kind)):
            one = type(wood.bodies)(*(a[r : r + 1] for a in wood.bodies))
            normal = np.zeros_like(m.x)
            smooth = one._replace(friction=np.zeros(1))
            centre, speed = s.centre[r : r + 1], s.speed[r : r + 1]
            press(m.x, m.v, normal, m.mass, m.held, smooth, centre, speed, dt, _RUBBING, np.zeros((1, 3)), np.zeros(2))
            size = np.linalg.norm(normal, axis=1)[free]
            n = normal[free] / np.maximum(size, 1e-300)[:, None]
            along = n[:, :, None] * n[:, None, :]
            slip = m.v[free] - speed[0]
            slip -= n * (slip * n).sum(1)[:, None]
            drag = one.friction[0] * size / np.maximum(np.linalg.norm(slip, axis=1), _RUBBING) / dt
            touching = size > 0
            out[touching] += (one.k[0] * along + drag[:, None, None] * (np.eye(3) - along))[touching]
        return out

    def solve(self, state: State, time: float, xh: np.ndarray, vh: np.ndarray, bdt: float, tolerance: float) -> float:
        """Find x and v of the step in place; return the relative residual.

        Raises:
            NotConverged: it is not found.

        """
        wood, p = state.wood, self._params
        m = wood.motion
        free = m.held == 0
        inertia = (1 / bdt + p.damping) / bdt
        least = 2e9 * floor(wood, p) / p.strain_limit / p.length * 1e-10

        def residual() -> np.ndarray:
            m.v[free] = (m.x[free] - xh[free]) / bdt
            forces(
                m,
                wood.rods,
                wood.bonds,
                wood.turns,
                wood.bodies,
                state.scratch,
                False,
                time,
                bdt,
                _RUBBING,
                state.books,
            )
            a = (m.v - vh) / bdt + p.damping * m.v
            return (m.mass[:, None] * a - state.scratch.f)[free].ravel()

        r = residual()
        norm = first = float(np.linalg.norm(r))
        wanted = max(tolerance * first, least)
        fresh = False
        for _ in range(_ITERATIONS):
            if norm <= wanted:
                return norm / max(first, least)
            if self._lu is None or self._key != (len(m.x), state.rods):
                self._factor(state, inertia, bdt)
                fresh = True
            assert self._lu is not None
            step = self._lu.solve(r).reshape(-1, 3)
            x, was = m.x[free].copy(), norm
            for share in (1.0, 0.5, 0.25, 0.0625):
                m.x[free] = x - share * step
                r = residual()
                norm = float(np.linalg.norm(r))
                if norm < was:
                    break
            if not norm < was:
                m.x[free] = x
                r = residual()
                norm = float(np.linalg.norm(r))
                if fresh:
                    break
            if not norm < _SLOW * was:
                self._factor(state, inertia, bdt)
                fresh = True
            else:
                fresh = False
        raise NotConverged(
            f"an implicit step of {bdt:.2g} s at t = {time:.4g} s was not solved.",
            advice="Give a shorter step, or take the explicit mode.",
            residual=norm / max(first, least),
        )

    def forget(self) -> None:
        """Drop the factor: the step has another length."""
        self._lu = None


def _grown(past: np.ndarray, parent: np.ndarray) -> np.ndarray:
    """Return what new vertices had before they were split off: what the split one had."""
    while len(past) < len(parent):
        past = np.vstack([past, past[parent[len(past)]]])
    return past


def _step(
    solver: _Solver, state: State, past: _Past | None, time: float, dt: float, depth: int
) -> tuple[State, _Past, float]:
    """Return the state a step later, its past, and the residual; halves the step where it is not solved.

    Raises:
        NotConverged: not even after `_HALVINGS` halvings.

    """
    params = solver._params
    m = state.wood.motion
    x0, v0, books0 = m.x.copy(), m.v.copy(), state.books.copy()
    if past is None:
        xh, vh, share = x0, v0, 1.0
    else:
        ratio = dt / past.dt
        one, two = (1 + ratio) ** 2 / (1 + 2 * ratio), ratio**2 / (1 + 2 * ratio)
        share = (1 + ratio) / (1 + 2 * ratio)
        xh, vh = one * x0 - two * past.x, one * v0 - two * past.v
    power0 = _power(state, params)
    m.x[:] = np.where(m.held[:, None] == 1, x0 + dt * v0, x0 + dt * v0 if past else x0)
    try:
        error = solver.solve(state, time + dt, xh, vh, share * dt, _TOLERANCE)
        if params.fracture != "none":
            for _ in range(_PASSES):
                found = broken(state, params, time + dt, dt)
                if found is state:
                    break
                state = found
                xh, vh = (_grown(a, state.wood.parent) for a in (xh, vh))
                error = solver.solve(state, time + dt, xh, vh, share * dt, _TOLERANCE)
    except NotConverged:
        if depth == _HALVINGS or len(state.wood.motion.x) > len(x0):
            raise
        m.x[:], m.v[:], state.books[:] = x0, v0, books0
        solver.forget()
        state, past, _ = _step(solver, _refreshed(state, time), past, time, dt / 2, depth + 1)
        state, past, error = _step(solver, state, past, time + dt / 2, dt / 2, depth + 1)
        solver.forget()
        return state, past, error
    power1 = _power(state, params)
    x0, v0 = (_grown(a, state.wood.parent) for a in (x0, v0))
    way = state.wood.motion.x - x0
    state.books[WORK] += dt / 2 * (power0[0] + power1[0]) + float((state.wood.motion.load * way).sum())
    state.books[LOST] += dt / 2 * (power0[1] + power1[1])
    state.impulse[:] += dt * state.scratch.push
    return state._replace(steps=state.steps + 1), _Past(x0, v0, dt), error


def _refreshed(state: State, time: float) -> State:
    w = state.wood
    forces(w.motion, w.rods, w.bonds, w.turns, w.bodies, state.scratch, False, time, 1e-9, _RUBBING, state.books)
    return state


def _power(state: State, params: WoodParams) -> tuple[float, float]:
    """Return the power of grips and bodies, and that lost by friction and damping [W]."""
    m = state.wood.motion
    held = m.held == 1
    grip = -float((state.scratch.f[held] * m.v[held]).sum())
    slowed = params.damping * float((m.mass[~held, None] * m.v[~held] ** 2).sum())
    return grip + float(state.scratch.power[0]), float(state.scratch.power[1]) + slowed


def _reached(time: float, state: State, start: float, error: float) -> Reached:
    energy = (
        kinetic(state.wood),
        float(state.books[: CONTACT + 1].sum()),
        float(state.books[LOST]),
        float(state.books[WORK]),
        start,
    )
    return Reached(time, state, energy, error, True)


def implicit(wood: Wood, params: WoodParams, times: Sequence[float], dt: float, context: Context) -> Iterator[Reached]:
    """Yield the state at each wanted time [s].

    Raises:
        NotConverged: a step was not solved, however short.
        Cancelled: the observer asked to stop.

    """
    state, past, error = begin(wood), None, 0.0
    start = kinetic(wood) + float(state.books[: CONTACT + 1].sum())
    solver, done = _Solver(params), 0
    for wanted in times:
        ahead = int(np.floor(wanted / dt * (1 + 1e-12)))
        while done < ahead:
            context.check_cancelled()
            state, past, error = _step(solver, state, past, done * dt, dt, 0)
            done += 1
            context.report(done * dt / times[-1], f"t = {done * dt:.4g} s")
        shown = state
        rest = wanted - ahead * dt
        if rest > 1e-9 * dt:
            # on a factor of its own: later steps must not know of this one
            shown, _, error = _step(_Solver(params), copied(state), past, ahead * dt, rest, 0)
        yield _reached(wanted, copied(shown), start, error)


def equilibrium(state: State, params: WoodParams, factor: float, full: np.ndarray) -> tuple[State, float]:
    """Return the state at rest under `factor` times the loads `full` (v, 3) [N], from one near it, and the residual.

    Raises:
        NotConverged: the way of loads could not be followed; residual and the factor reached say how far it came.

    """
    wood = state.wood
    m = wood.motion
    free = m.held == 0
    stiffness = Stiffness(wood.rods, wood.bonds, free)
    reached, increment = 0.0, 1.0
    share = np.linalg.norm(full) or 1.0
    begun = float((m.load * full).sum() / share**2)
    least = 2e9 * floor(wood, params) / params.strain_limit / params.length * 1e-9
    while reached < 1:
        goal = min(reached + increment, 1.0)
        x = m.x.copy()
        m.load[:] = full * (begun + goal * (factor - begun))
        norm, wanted = np.inf, max(_TOLERANCE * float(np.linalg.norm(m.load)), least)
        for _ in range(30):
            forces(m, wood.rods, wood.bonds, wood.turns, wood.bodies, state.scratch, False, 0.0, 1.0, 1.0, state.books)
            r = state.scratch.f[free].ravel()
            last, norm = norm, float(np.linalg.norm(r))
            if norm <= wanted or not np.isfinite(norm) or norm > 1e6 * max(last, 1e-300):
                break
            matrix = stiffness.matrix(m.x, wood.rods, wood.bonds, 1e-12 * float(wood.rods.k.max() / params.length))
            step = splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(r).reshape(-1, 3)
            # a step that turns edges by more than a radian is not one of Newton's
            m.x[free] += step * min(1.0, float(wood.rods.rest.min()) / max(float(np.abs(step).max()), 1e-300))
        if norm <= wanted:
            reached, increment = goal, 2 * increment
            continue
        m.x[:], increment = x, increment / 4
        if increment < 1e-4:
            raise NotConverged(
                f"no equilibrium was found beyond {begun + reached * (factor - begun):.3g} times the loads.",
                advice="Apply smaller loads, or take the implicit mode.",
                residual=norm / max(wanted / _TOLERANCE, 1e-300),
            )
    return state, norm / max(float(np.linalg.norm(m.load)), least / _TOLERANCE)


def static(wood: Wood, params: WoodParams, times: Sequence[float], context: Context) -> Iterator[Reached]:
    """Yield equilibria; loads grow evenly with time and have their full size at 1 s.

    Raises:
        NotConverged: there is none.
        Cancelled: the observer asked to stop.

    """
    full = wood.motion.load.copy()
    wood.motion.load[:] = 0.0
    wood.motion.v[:] = 0.0
    state, error = begin(wood), 0.0
    start = float(state.books[: CONTACT + 1].sum())
    for wanted in times:
        context.check_cancelled()
        before, load = state.wood.motion.x.copy(), state.wood.motion.load.copy()
        state, error = equilibrium(state, params, wanted, full)
        way = state.wood.motion.x - before
        state.books[WORK] += float(((load + state.wood.motion.load) / 2 * way).sum())
        yield _reached(wanted, copied(state._replace(steps=state.steps + 1)), start, error)
        state = state._replace(steps=state.steps + 1)
