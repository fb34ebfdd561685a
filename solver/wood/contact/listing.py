"""Which rods may touch, kept up while they move: lists of `pairs.pairs` with a margin.

Pairs stay listed while no vertex has left its own margin (after Verlet 1967), also where rods break. Of those, what a
whole bond holds apart does not touch: in a bundle that is whole nothing is looked at. A bond that is once pressed to
nearly the thickness holds nothing apart any more.
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
_THICK, _MARGIN = 0.8, 0.3
#: How many times as far as it goes ahead a vertex may go besides until pairs are listed anew. At 16 times, the moments
#: after a break, when all moves, list everything.
_AHEAD = 6.0
#: Length of a bond over the thickness at which it no longer holds apart; the closest are laid at 1 / `_THICK`.
_PRESSED = 1.1
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
def _squeezed(x: np.ndarray, rods: Rods, bonds: Bonds, least: float, holds: np.ndarray) -> int:
    """Take from holds (b,) the bonds that are broken, on stubs, or shorter than `least` [m]; return how many."""
    found = 0
    for b in range(len(holds)):
        if holds[b] == 0:
            continue
        short = 0.0
        for c in range(3):
            i, j = bonds.i[b], bonds.j[b]
            one = x[rods.a[i], c] + bonds.at[b] * (x[rods.b[i], c] - x[rods.a[i], c])
            short += (one - x[rods.a[j], c] - bonds.share[b] * (x[rods.b[j], c] - x[rods.a[j], c])) ** 2
        # what sits on a stub holds nothing of the edge that carries it
        stub = min(bonds.at[b], bonds.share[b]) < 0.0 or max(bonds.at[b], bonds.share[b]) > 1.0
        if bonds.on[b] != 1 or stub or short < least * least:
            holds[b] = 0
            found += 1
    return found


@njit(cache=True, error_model="numpy")
def _apart(pair: np.ndarray, rods: Rods, i: np.ndarray, j: np.ndarray, holds: np.ndarray) -> np.ndarray:
    """Return which pairs (p,) of edges no bond holds apart: none from the one edge to the other or one joined to it.

    Nor does one where either edge has lost a bond: edges are long beside their thickness, and may cross beside it.
    i, j (b,): edges of bonds; holds (b,): 1 where one does.
    """
    count = len(rods.a)
    lost = np.zeros(count, np.uint8)
    for b in range(len(i)):
        if holds[b] == 0:
            lost[i[b]] = lost[j[b]] = 1
    first = np.zeros(count + 1, np.int64)
    for b in range(len(i)):
        if holds[b] == 1:
            first[i[b] + 1] += 1
            first[j[b] + 1] += 1
    for e in range(count):
        first[e + 1] += first[e]
    to = np.empty(first[count], np.int64)
    free = first[:count].copy()
    for b in range(len(i)):
        if holds[b] == 1:
            to[free[i[b]]] = j[b]
            free[i[b]] += 1
            to[free[j[b]]] = i[b]
            free[j[b]] += 1
    found = np.ones(len(pair), np.bool_)
    for m in range(len(pair)):
        for k in range(2):
            e, w = pair[m, k], pair[m, 1 - k]
            if lost[e] == 1 or lost[w] == 1:
                continue
            for n in range(first[e], first[e + 1]):
                o = to[n]
                # not so of another piece of the same rod
                if o == w or rods.a[o] == rods.b[w] or rods.b[o] == rods.a[w]:
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
        self._holds = np.ones(len(wood.bonds.i), np.uint8)
        self._rubbing = Rubbing(np.zeros((0, 2), np.int32), self._law)

    def _listed(self, wood: Wood, span: float) -> Rubbing:
        """Return pairs that hold for `span` [s]."""
        fresh = self._near is None or not self._near.holds(wood, span)
        if self._near is None or fresh:
            self._near = Near(wood, self._thick, span)
        bonds: Bonds = wood.bonds
        if _squeezed(wood.motion.x, wood.rods, bonds, _PRESSED * self._thick, self._holds) or fresh:
            pair = self._near.pair
            self._rubbing = Rubbing(pair[_apart(pair, wood.rods, bonds.i, bonds.j, self._holds)], self._law)
        return self._rubbing

    def fitted(self, state: State, span: float = 0.0) -> State:
        """Return the state with pairs that hold where it is, and for `span` [s] as it moves."""
        if not self.on:
            return state
        rubbing = self._listed(state.wood, span)
        if rubbing is state.scratch.rubbing:
            return state
        return state._replace(scratch=state.scratch._replace(rubbing=rubbing))
