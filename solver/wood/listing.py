"""Which rods may touch, kept up while they move: lists of `rubbing.pairs` with a margin."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .arrays import Rods
from .explicit import LOST, forces
from .moment import State
from .params import WoodParams
from .rubbing import Rubbing, pairs
from .state import Wood

__all__ = ["Listing", "law"]

#: Thickness over the least distance of rods as laid, and the list's margin over the thickness.
_THICK, _MARGIN = 0.8, 0.5
#: Share of an edge's stiffness that a contact of rods has, as that of bodies.
_CONTACT = 0.1


def law(wood: Wood, params: WoodParams) -> np.ndarray:
    """Return thickness [m], stiffness [N/m] and friction (3,) of contacts between rods."""
    rods: Rods = wood.rods
    feet = wood.motion.x[wood.grid[:, 0]]
    apart = np.asarray(cKDTree(feet).query(feet, 2)[0])
    least = float(apart[:, 1].min()) if len(feet) > 1 else 0.0
    real = rods.k > 0
    stiff = params.contact_stiffness or _CONTACT * float(np.median(rods.k[real] / rods.rest[real]))
    return np.array([min(_THICK * least, 2 * float(rods.radius.min())), stiff, params.rod_friction])


class Listing:
    """The listed pairs of one run; without contact of rods, always none."""

    def __init__(self, wood: Wood, params: WoodParams) -> None:
        self._law = law(wood, params)
        self._on = params.rod_contact and self._law[0] > 0
        self._x, self._breaks, self._slack = wood.motion.x, (-1, -1), 0.0

    def refreshed(self, state: State, ahead: float, time: float, dt: float) -> State:
        """Return the state with pairs that hold for `ahead` [s] from `time` [s].

        A bond that broke frees its rods to touch; energy that they then have is booked as taken from what is lost.
        """
        if not self._on:
            return state
        m, breaks = state.wood.motion, (state.rods, state.bonds)
        way = ahead * float(np.sqrt((m.v**2).sum(1).max()))
        if breaks == self._breaks:
            moved = float(np.sqrt(((m.x - self._x) ** 2).sum(1).max()))
            if 2 * (moved + way) < self._slack:
                return state
        w = state.wood
        self._slack = _MARGIN * self._law[0] + 2 * way
        found = pairs(m.x, w.rods, w.bonds, w.rod, self._law[0] + self._slack)
        self._x, self._breaks = m.x.copy(), breaks
        state = state._replace(scratch=state.scratch._replace(rubbing=Rubbing(found, self._law)))
        before = float(state.books[:4].sum())
        forces(w.motion, w.rods, w.bonds, w.turns, w.bodies, state.scratch, w.turning, time, dt, 0.0, state.books)
        state.books[LOST] += before - float(state.books[:4].sum())
        return state
