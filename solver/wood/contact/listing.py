"""Which rods may touch, kept up while they move: lists of `pairs.pairs` with a margin.

Pairs stay listed while no vertex has moved by half the list's margin (Verlet 1967).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..model.arrays import Rods, Rubbing
from ..model.state import State, Wood
from ..params import WoodParams
from .pairs import pairs

__all__ = ["Listing", "Near", "law"]

#: Thickness over the least distance of rods as laid, and the list's margin over the thickness.
_THICK, _MARGIN = 0.8, 0.5
#: Share of an edge's stiffness that a contact of rods has: about as round rods of wood that cross have across the grain
#: (Hertz).
_CONTACT = 0.02
#: Depth over which a contact of rods gains its stiffness, over the thickness.
_EASE = 0.05


def law(wood: Wood, params: WoodParams) -> np.ndarray:
    """Return thickness [m], stiffness [N/m], friction and easing depth [m] (4,) of contacts between rods."""
    rods: Rods = wood.rods
    feet = wood.motion.x[wood.grid[:, 0]]
    apart = np.asarray(cKDTree(feet).query(feet, 2)[0])
    least = float(apart[:, 1].min()) if len(feet) > 1 else 0.0
    real = rods.k > 0
    stiff = params.contact_stiffness or _CONTACT * float(np.median(rods.k[real] / rods.rest[real]))
    thick = min(_THICK * least, 2 * float(rods.radius.min()))
    return np.array([thick, stiff, params.rod_friction, _EASE * thick])


class Near:
    """Pairs that were within the thickness and some slack when they were listed."""

    def __init__(self, wood: Wood, thick: float, slack: float) -> None:
        """List all such pairs."""
        self._x, self._whole = wood.motion.x.copy(), (wood.rods.alive.copy(), wood.parent)
        self._slack = slack
        self.pair = pairs(self._x, wood.rods, wood.rod, thick + slack)

    def left(self, wood: Wood) -> float:
        """Return the slack that is left [m]; negative if a rod has broken since."""
        now = wood.rods.alive, wood.parent
        if not all(map(np.array_equal, now, self._whole)):
            return -1.0
        return self._slack - 2 * float(np.sqrt(((wood.motion.x - self._x) ** 2).sum(1).max()))


class Listing:
    """The listed pairs of one run; without contact of rods, always none."""

    def __init__(self, wood: Wood, params: WoodParams) -> None:
        self._law = law(wood, params)
        self._thick, self._margin = float(self._law[0]), _MARGIN * float(self._law[0])
        self.on = params.rod_contact and self._thick > 0
        self._near: Near | None = None
        self._rubbing = Rubbing(np.zeros((0, 2), np.int32), self._law)

    def _listed(self, wood: Wood, ahead: float) -> Rubbing:
        """Return pairs that hold until a vertex has moved by `ahead` [m]."""
        if self._near is not None and self._near.left(wood) > 2 * ahead:
            return self._rubbing
        slack = self._margin + 2 * ahead
        self._near = Near(wood, self._thick, slack)
        self._rubbing = Rubbing(self._near.pair, self._law)
        return self._rubbing

    def fitted(self, state: State, ahead: float = 0.0) -> State:
        """Return the state with pairs that hold where it is, and until a vertex has moved by `ahead` [m]."""
        if not self.on:
            return state
        rubbing = self._listed(state.wood, ahead)
        if rubbing is state.scratch.rubbing:
            return state
        return state._replace(scratch=state.scratch._replace(rubbing=rubbing))
