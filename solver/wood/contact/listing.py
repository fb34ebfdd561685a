"""Which rods may touch, kept up while they move: lists of `pairs.pairs` with a margin.

Pairs stay listed while no vertex has left its own margin (after Verlet 1967), also where rods break. Of those, what
whole bonds hold together does not touch: bonds resist pressure themselves, and in a bundle that is whole nothing is
looked at.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ..model.arrays import Bonds, Rods, Rubbing
from ..model.state import State, Wood
from ..params import WoodParams
from .pairs import pairs

__all__ = ["Listing", "Near", "law"]

#: Thickness over the least distance of rods as laid, and the list's margin over the thickness.
_THICK, _MARGIN = 0.8, 1.0
#: How many times as far as it goes ahead a vertex may go besides until pairs are listed anew. At 16 times, the moments
#: after a break, when all moves, list everything.
_AHEAD = 10.0
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


@njit(cache=True, error_model="numpy")
def _apart(pair: np.ndarray, rod: np.ndarray, i: np.ndarray, j: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Return which pairs (p,) of edges no whole bond holds together: none from the one edge to the other one's rod.

    i, j, on (b,): as `Bonds` has them; rod (e,).
    """
    count = len(rod)
    first = np.zeros(count + 1, np.int64)
    for b in range(len(i)):
        if on[b] == 1:
            first[i[b] + 1] += 1
            first[j[b] + 1] += 1
    for e in range(count):
        first[e + 1] += first[e]
    to = np.empty(first[count], np.int64)
    free = first[:count].copy()
    for b in range(len(i)):
        if on[b] == 1:
            to[free[i[b]]] = rod[j[b]]
            free[i[b]] += 1
            to[free[j[b]]] = rod[i[b]]
            free[j[b]] += 1
    found = np.ones(len(pair), np.bool_)
    for m in range(len(pair)):
        for k in range(2):
            e = pair[m, k]
            other = rod[pair[m, 1 - k]]
            for n in range(first[e], first[e + 1]):
                if to[n] == other:
                    found[m] = False
    return found


@njit(cache=True, error_model="numpy")
def _left(x: np.ndarray, v: np.ndarray, was: np.ndarray, pad: np.ndarray, span: float) -> bool:
    """Return whether a vertex leaves its margin pad (v,) [m] about `was` (v, 3) within `span` [s], as it moves now."""
    for i in range(len(x)):
        square = 0.0
        for c in range(3):
            # the farther of now and then
            way = abs(x[i, c] - was[i, c]) + span * abs(v[i, c])
            square += way * way
        if square > pad[i] * pad[i]:
            return True
    return False


class Near:
    """Pairs that come within the thickness while no vertex leaves its margin: what flies has a wider one."""

    def __init__(self, wood: Wood, thick: float, span: float) -> None:
        """List all such pairs; span [s]: the time ahead that they must hold."""
        m = wood.motion
        self._x = m.x.copy()
        self._pad = 0.5 * _MARGIN * thick + _AHEAD * span * np.sqrt((m.v**2).sum(1))
        more = np.maximum(self._pad[wood.rods.a], self._pad[wood.rods.b])
        self.pair = pairs(self._x, wood.rods, wood.rod, thick, more)

    def holds(self, wood: Wood, span: float) -> bool:
        """Return whether no vertex leaves its margin within `span` [s]."""
        # what was split from a vertex was where that was
        for i in range(len(self._x), len(wood.motion.x)):
            self._x = np.vstack([self._x, self._x[wood.parent[i]]])
            self._pad = np.append(self._pad, self._pad[wood.parent[i]])
        return not _left(wood.motion.x, wood.motion.v, self._x, self._pad, span)


class Listing:
    """The listed pairs of one run; without contact of rods, always none."""

    def __init__(self, wood: Wood, params: WoodParams) -> None:
        self._law = law(wood, params)
        self._thick = float(self._law[0])
        self.on = params.touching and self._thick > 0
        self._near: Near | None = None
        self._parted = -1
        self._rubbing = Rubbing(np.zeros((0, 2), np.int32), self._law)

    def _listed(self, wood: Wood, parted: int, span: float) -> Rubbing:
        """Return pairs that hold for `span` [s]; parted: bonds that broke so far."""
        fresh = self._near is None or not self._near.holds(wood, span)
        if self._near is None or fresh:
            self._near = Near(wood, self._thick, span)
        if fresh or parted != self._parted:
            bonds: Bonds = wood.bonds
            pair, self._parted = self._near.pair, parted
            self._rubbing = Rubbing(pair[_apart(pair, wood.rod, bonds.i, bonds.j, bonds.on)], self._law)
        return self._rubbing

    def fitted(self, state: State, span: float = 0.0) -> State:
        """Return the state with pairs that hold where it is, and for `span` [s] as it moves."""
        if not self.on:
            return state
        rubbing = self._listed(state.wood, state.bonds, span)
        if rubbing is state.scratch.rubbing:
            return state
        return state._replace(scratch=state.scratch._replace(rubbing=rubbing))
