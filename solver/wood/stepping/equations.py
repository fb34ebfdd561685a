"""The equations of one implicit step: residual, products with the stiffness, and how far a step can be trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..contact.listing import Listing
from ..contact.stiffness import RUBBING, Contacts, contacts
from ..forces.elements import Elements, apply, elements
from ..params import WoodParams
from .explicit import forces
from .moment import State

__all__ = ["Equations", "Step", "filled"]

#: How far an edge's ends move against each other in one step of Newton's, over its length.
_TURN = 0.3


class Step(NamedTuple):
    """What a step sets out from: xh, vh (v, 3), b dt [s], its end [s]."""

    xh: np.ndarray
    vh: np.ndarray
    bdt: float
    time: float


def filled(state: State, time: float, bdt: float, listing: Listing) -> np.ndarray:
    """Fill the state's forces for its x and v at `time` [s]; return them (v, 3) [N]."""
    w, s = state.wood, listing.fitted(state).scratch
    forces(w.motion, w.rods, w.bonds, w.turns, w.bodies, s, False, time, bdt, RUBBING, state.books)
    return s.f


@dataclass(frozen=True, eq=False)
class Equations:
    """A state, whose x and v they set, and the step that it is to take."""

    state: State
    step: Step
    params: WoodParams
    listing: Listing

    @property
    def inertia(self) -> np.ndarray:
        """What mass and damping add to the stiffness (v,) [N/m]."""
        inertia: np.ndarray = self.state.wood.motion.mass * (1 / self.step.bdt + self.params.damping) / self.step.bdt
        return inertia

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Move the state to x (v, 3); return what is out of balance (v, 3) [N], zero where held."""
        m, step = self.state.wood.motion, self.step
        held = m.held == 1
        v = (x - step.xh) / step.bdt
        v[held] = m.v[held]
        m.x[:], m.v[:] = x, v
        f = filled(self.state, step.time, step.bdt, self.listing)
        r: np.ndarray = m.mass[:, None] * ((v - step.vh) / step.bdt + self.params.damping * v) - f
        r[held] = 0.0
        return r

    def parts(self, positive: bool) -> tuple[Elements, Contacts]:
        """Return the second derivatives where the state is, or the positive ones among them."""
        w, state = self.state.wood, self.listing.fitted(self.state)
        return elements(w.motion.x, w.rods, w.bonds, positive), contacts(state, self.step.bdt, positive)

    def stiffness(self, positive: bool) -> Callable[[np.ndarray], np.ndarray]:
        """Return the product with them and the inertia."""
        parts, touching = self.parts(positive)
        inertia, held = self.inertia[:, None], self.state.wood.motion.held == 1

        def times(way: np.ndarray) -> np.ndarray:
            out: np.ndarray = inertia * way
            apply(parts, way, out)
            touching.add(way, out)
            out[held] = 0.0
            return out

        return times

    def limit(self, way: np.ndarray) -> float:
        """Return the share of a step (v, 3) that turns and stretches no edge by much, and passes through no body."""
        rods, bodies = self.state.wood.rods, self.state.wood.bodies
        contact = 0.2 * float(bodies.half[:, 0].min()) if len(bodies.kind) else np.inf
        apart = np.linalg.norm(way[rods.b] - way[rods.a], axis=1)
        share = 1.0 / max(float((apart / (_TURN * rods.rest)).max(initial=0.0)), 1e-300)
        share = min(share, contact / max(float(np.abs(way).max()), 1e-300))
        return self.listing.allowed(self.state, way, share)
