"""One implicit step's equations, solved with a factor that lasts over many steps."""

from __future__ import annotations

from copy import copy
from functools import partial

import numpy as np

from ...contract import NotConverged
from ..contact.listing import Listing
from ..contact.stiffness import contacts, lag
from ..params import WoodParams
from .equations import Equations, Step, filled
from .explicit import CONTACT
from .moment import State, strength
from .newton import descend
from .precondition import Pattern, Preconditioner, preconditioner

__all__ = ["Solver"]

#: Solves before a stale factor is given up, and factors before a step is.
_SOLVES, _FACTORS = 60, 5
#: Solves with a fresh factor over those with a stale one: a piece that swings on one bond takes many short steps.
_PATIENCE = 4
#: Solves that a round takes with a fresh factor. A factor is renewed when it has cost so many more than a new one does.
_FRESH, _EXCESS = 3, 40
#: What a step may be longer or shorter than that of the factor.
_SAME = 3.0
#: The least residual that is asked for: this share of the tolerance, of the load that the bundle bears.
_LEAST = 1e-4
#: What a solve between two breaks may leave of the residual that the last break made.
_KICK = 0.25


class Solver:
    """The iteration with its factor, over one run."""

    def __init__(self, params: WoodParams, tolerance: float, listing: Listing) -> None:
        self.params, self.tolerance, self.listing = params, tolerance, listing
        self._factor: Preconditioner | None = None
        self._pattern: Pattern | None = None
        self._key: tuple[int, int, bytes] | None = None
        self._bdt, self._excess = 0.0, 0
        self._double = False

    def _renew(self, state: State, bdt: float) -> None:
        wood = state.wood
        m = wood.motion
        # bonds change hands and vertices are added only by breaks of rods
        touching = contacts(self.listing.fitted(state), bdt, True)
        key = (len(m.x), state.rods, touching.couples().tobytes())
        pattern = self._pattern if self._key == key else None
        inertia = m.mass * (1 / bdt + self.params.damping) / bdt
        self._factor, self._pattern = preconditioner(
            m.x, wood.rods, wood.bonds, m.held == 0, inertia, touching, pattern, self._double
        )
        self._key, self._bdt, self._excess = key, bdt, 0

    def twin(self) -> Solver:
        """Return a solver that sets out with the same factor, and of which this one learns nothing."""
        found = Solver(self.params, self.tolerance, copy(self.listing))
        found._factor, found._pattern, found._key, found._bdt = self._factor, self._pattern, self._key, self._bdt
        found._double = self._double
        return found

    def lag(self, state: State) -> None:
        """Take the normal forces where the state is as those that friction follows."""
        lag(state)
        self.listing.lag(state)

    def again(self, state: State, time: float, dt: float) -> np.ndarray:
        """Return the forces (v, 3) [N] after breaks, friction following the normal forces there."""
        self.lag(state)
        return filled(state, time, dt, self.listing).copy()

    def _stale(self, vertices: int, bdt: float) -> bool:
        """Return whether the factor does not serve: too old, or of vertices that a step taken back had split."""
        if self._factor is None or len(self._factor.free) > vertices:
            return True
        return not 1 / _SAME < bdt / self._bdt < _SAME or self._excess > _EXCESS

    def solve(
        self, state: State, step: Step, guesses: tuple[np.ndarray, ...], least: float, rough: float = 1.0
    ) -> tuple[float, float]:
        """Find x and v of the step in place, from the better of the guesses (v, 3), `rough` times the tolerance off.

        Returns the relative residual and what it is relative to, at least `least` [N].

        Raises:
            NotConverged: it is not found.

        """
        wood = state.wood
        m = wood.motion
        equations = Equations(state, step, self.params, self.listing)
        residual = equations.residual
        guesses = tuple(self.listing.near(state, x) for x in guesses)
        norms = [float(np.linalg.norm(residual(x))) for x in guesses]
        x = guesses[int(np.nanargmin(norms))]
        scale = max(norms[0], _LEAST * strength(wood, self.params), least)
        wanted = rough * self.tolerance * scale
        if rough > 1:
            wanted = max(wanted, _KICK * norms[0])
        # energies go with the square of forces
        little = rough * self.tolerance**2 * float(state.books[: CONTACT + 1].sum())
        root = np.arange(len(m.x))
        norm = min(norms)
        for attempt in range(_FACTORS):
            if attempt or self._stale(len(m.x), step.bdt):
                residual(x)
                self._renew(state, step.bdt)
            assert self._factor is not None
            most = _SOLVES * (_PATIENCE if attempt else 1)
            old = len(self._factor.free)
            while (root >= old).any():
                root = np.where(root >= old, wood.parent[root], root)
            factor = self._factor
            found = descend(
                residual,
                equations.stiffness,
                x,
                partial(factor.solve, root=root),
                wanted,
                most,
                equations.limit,
                little,
                not self._double,
            )
            # single precision is too little for loose pieces: their inertia is 1e-8 of an edge's stiffness
            self._double = self._double or found.poor
            x, norm = found.x, found.norm
            self._excess += max(found.solves - _FRESH * found.rounds, 0)
            if found.settled:
                residual(x)
                return norm / scale, scale
        raise NotConverged(
            f"an implicit step of {step.bdt:.2g} s at t = {step.time:.4g} s was not solved.",
            advice="Give a shorter step, or take the explicit mode, for slow loads with mass_scaling.",
            residual=norm / scale,
        )
