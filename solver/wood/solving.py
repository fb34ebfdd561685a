"""One implicit step's equations, solved with a factor that lasts over many steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from ..contract import NotConverged
from .contact import RUBBING, contacts, lag
from .elements import apply, elements
from .explicit import CONTACT, forces
from .hessian import Stiffness
from .listing import Listing
from .moment import State, strength
from .newton import descend
from .params import WoodParams
from .precondition import Preconditioner, preconditioner

__all__ = ["Solver", "Step"]

#: Solves before a stale factor is given up, and factors before a step is.
_SOLVES, _FACTORS = 60, 5
#: Solves with a fresh factor over those with a stale one: a piece that swings on one bond takes many short steps.
_PATIENCE = 4
#: A factor is renewed when it has cost this many solves more than a fresh one would have: about what a new one costs.
_EXCESS = 40
#: The least residual that is asked for: this share of the tolerance, of the load that the bundle bears.
_LEAST = 1e-4
#: How far an edge's ends move against each other in one step of Newton's, over its length.
_TURN = 0.3


class Step(NamedTuple):
    """What a step sets out from: xh, vh (v, 3), b dt [s], its end [s]."""

    xh: np.ndarray
    vh: np.ndarray
    bdt: float
    time: float


class Solver:
    """The iteration with its factor, over one run."""

    def __init__(self, params: WoodParams, tolerance: float, listing: Listing) -> None:
        self.params, self.tolerance, self.listing = params, tolerance, listing
        self._factor: Preconditioner | None = None
        self._pattern: Stiffness | None = None
        self._key: tuple[int, int, bytes] | None = None
        self._bdt, self._fresh, self._excess = 0.0, 0, 0
        self.factors, self.solves = 0, 0

    def _renew(self, state: State, bdt: float) -> None:
        wood = state.wood
        m = wood.motion
        # bonds change hands and vertices are added only by breaks of rods
        touching = contacts(self.listing.fitted(state), bdt, True)
        key = (len(m.x), state.rods, touching.couples().tobytes())
        pattern = self._pattern if self._key == key else None
        inertia = m.mass * (1 / bdt + self.params.damping) / bdt
        self._factor, self._pattern = preconditioner(
            m.x, wood.rods, wood.bonds, m.held == 0, inertia, touching, pattern
        )
        self._key, self._bdt, self._fresh, self._excess = key, bdt, 0, 0
        self.factors += 1

    def forces(self, state: State, time: float, dt: float) -> np.ndarray:
        """Fill the state's forces for its x and v at `time`; return them (v, 3) [N]."""
        w, s = state.wood, self.listing.fitted(state).scratch
        forces(w.motion, w.rods, w.bonds, w.turns, w.bodies, s, False, time, dt, RUBBING, state.books)
        return state.scratch.f

    def lag(self, state: State) -> None:
        """Take the normal forces where the state is as those that friction follows."""
        lag(state)
        self.listing.lag(state)

    def again(self, state: State, time: float, dt: float) -> np.ndarray:
        """Return the forces (v, 3) [N] after breaks, friction following the normal forces there."""
        self.lag(state)
        return self.forces(state, time, dt).copy()

    def solve(
        self, state: State, step: Step, guesses: tuple[np.ndarray, ...], least: float, rough: float = 1.0
    ) -> tuple[float, float]:
        """Find x and v of the step in place, from the better of the guesses (v, 3), `rough` times the tolerance off.

        Returns the relative residual and what it is relative to, at least `least` [N].

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

        guesses = tuple(self.listing.near(state, x) for x in guesses)
        norms = [float(np.linalg.norm(residual(x))) for x in guesses]
        x = guesses[int(np.nanargmin(norms))]
        scale = max(norms[0], _LEAST * strength(wood, p), least)
        wanted = rough * self.tolerance * scale
        # energies go with the square of forces
        little = rough * self.tolerance**2 * float(state.books[: CONTACT + 1].sum())
        contact = 0.2 * float(wood.bodies.half[:, 0].min()) if len(wood.bodies.kind) else np.inf
        first, second = wood.rods.a, wood.rods.b
        turned = _TURN * wood.rods.rest

        def limit(way: np.ndarray) -> float:
            """Return the share of a step that turns and stretches no edge by much, and passes through no body."""
            apart = np.linalg.norm(way[second] - way[first], axis=1)
            share = 1.0 / max(float((apart / turned).max()), 1e-300)
            share = min(share, contact / max(float(np.abs(way).max()), 1e-300))
            return self.listing.allowed(state, way, share)

        inertia = (m.mass * (1 / step.bdt + p.damping) / step.bdt)[:, None]

        def stiffness(positive: bool) -> Callable[[np.ndarray], np.ndarray]:
            parts = elements(m.x, wood.rods, wood.bonds, positive)
            touching = contacts(self.listing.fitted(state), step.bdt, positive)

            def times(way: np.ndarray) -> np.ndarray:
                out: np.ndarray = inertia * way
                apply(parts, way, out)
                touching.add(way, out)
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
            most = _SOLVES * (_PATIENCE if attempt else 1)
            old = len(self._factor.free)
            while (root >= old).any():
                root = np.where(root >= old, wood.parent[root], root)
            factor = self._factor
            found = descend(residual, stiffness, x, partial(factor.solve, root=root), wanted, most, limit, little)
            self.solves += found.solves
            x, norm = found.x, found.norm
            if not self._fresh:
                self._fresh = found.solves + 1
            self._excess += max(found.solves - self._fresh, 0)
            if found.settled:
                residual(x)
                return norm / scale, scale
        raise NotConverged(
            f"an implicit step of {step.bdt:.2g} s at t = {step.time:.4g} s was not solved.",
            advice="Give a shorter step, or take the explicit mode.",
            residual=norm / scale,
        )
