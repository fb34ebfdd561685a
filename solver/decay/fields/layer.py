"""One organism and its nutrient on the surface: a state, and one symmetric step of all that happens to it.

Strang splitting, second order: half of [react, spread, react], the nutrient's diffusion, half again. Reaction and
spreading run over the listed vertices only (where something lives, and a few rings about it): they cost what is
infected. The nutrient's diffusion runs everywhere, with three to five stages per step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ..surfaces.surface import Surface
from .diffusion import Links, linked, listed_around, rkl2, stages_for
from .rates import Rates
from .reaction import react

__all__ = ["Layer", "State"]


#: Rings about what lives that a step may reach; beyond them densities fall doubly exponentially (D ~ u).
_RINGS = 3
#: Density below which nothing lives, over d2.
_CUT = 1e-8
_NO_ROT: Floats = np.empty(0)


class State(NamedTuple):
    """Active u, inactive v and nutrient n, each (v), and the mean density that was added from outside."""

    u: Floats
    v: Floats
    n: Floats
    added: float


class Layer:
    """An organism on a surface. `coarse` (v) is the random factor 1 + delta on motility, Eq. 5."""

    def __init__(self, surface: Surface, rates: Rates, fresh: Floats, coarse: Floats) -> None:
        self.surface, self.rates = surface, rates
        self._coarse = coarse
        self._all = np.arange(len(fresh))
        self._everywhere = self._linked(np.ones_like(fresh), _NO_ROT, self._all)
        self._even = np.ones_like(fresh)
        zero = np.zeros_like(fresh)
        self.fresh = State(zero, zero, fresh, 0.0)
        self._store = rates.theta * surface.mean(fresh)

    def taken_by(self, rates: Rates) -> None:
        """Let another organism live here, where none has been until now."""
        self._store *= rates.theta / self.rates.theta
        self.rates = rates

    def share(self, state: State) -> Floats:
        """Return u + v over what the nutrient n = 1 can feed: the organism's map, 0 to 1."""
        return np.minimum((state.u + state.v) / self.rates.theta, 1.0)

    def advance(
        self,
        state: State,
        dt: float,
        rot: Floats = _NO_ROT,
        rates: Rates | None = None,
        pace: Floats | None = None,
    ) -> State:
        """Return the state dt [day] later. rot (v): the map whose gate says where the organism may spread.

        rates: those of this step, where the climate changes them. pace (v): over them, where it differs by place.
        """
        rates = rates or self.rates
        if rates.consume == 0 and rates.mobility == 0 and rates.feed == 0 and rates.wither == 0:
            return state  # frozen, or too hot
        pace = self._even if pace is None else pace
        u, v, n = state.u.copy(), state.v.copy(), state.n.copy()
        s = self.surface
        listed = listed_around(u, _CUT * self.rates.cap, _RINGS, s.start, s.near)
        self._half(u, v, n, listed, dt / 2, rot, rates, pace)
        if rates.feed > 0:
            stages = stages_for(dt, rates.feed * s.stiffest)
            rkl2(n, self._everywhere, rates.feed, 0.0, dt, stages, self._all, s.area)
        self._half(u, v, n, listed, dt / 2, rot, rates, pace)
        return State(u, v, n, state.added)

    def _half(
        self,
        u: Floats,
        v: Floats,
        n: Floats,
        listed: Ints,
        dt: float,
        rot: Floats,
        rates: Rates,
        pace: Floats,
    ) -> None:
        s = self.surface
        if not len(listed):
            return
        react(u, v, n, listed, dt / 2, pace, rates)
        c = self._coarse * n * pace
        # two stages would be stable but less accurate
        stages = max(3, stages_for(dt, rates.fastest * s.stiffest * float(c[listed].max())))
        rkl2(u, self._linked(c, rot, listed), rates.mobility, rates.cap, dt, stages, listed, s.area)
        react(u, v, n, listed, dt / 2, pace, rates)

    def _linked(self, c: Floats, rot: Floats, listed: Ints) -> Links:
        s = self.surface
        return linked(c, rot, listed, s.start, s.near, s.weight, s.area)

    def seeded(
        self, state: State, centre: Floats, radius: float, gate: Floats | None = None, share: float = 1.0
    ) -> State:
        """Return the state with a new colony: a smooth bump of a share of d2 about a point (3), times the gate.

        Its total does not depend on the mesh; a mesh coarser than the bump takes it all at the nearest vertex. What
        has flesh below gets the half of the ball there, too.
        """
        skin = self.surface.skin
        count, height = len(skin.points), share * self.rates.cap
        bump = _bump(skin.points, centre, radius, skin.area, height * np.pi * radius**2 / 3, gate)
        if count < len(self.surface.points):
            below, room = self.surface.points[count:], self.surface.area[count:]
            bump = np.concatenate([bump, _bump(below, centre, radius, room, height * 16 * np.pi * radius**3 / 105)])
        return self._with(state, bump)

    def painted(self, state: State, share: Floats) -> State:
        """Return the state with colonies of height d2 where share (v), 0 to 1, is 1."""
        return self._with(state, self.rates.cap * share)

    def _with(self, state: State, more: Floats) -> State:
        """Return the state with more of the organism on the skin (v), where all of it enters."""
        if len(more) < len(state.u):
            more = np.concatenate([more, np.zeros(len(state.u) - len(more))])
        return state._replace(u=state.u + more, added=state.added + self.surface.mean(more))

    def budget_error(self, state: State) -> float:
        """Return what is missing of theta n + u + v, over what there was and what was added."""
        total = self.surface.mean(self.rates.theta * state.n + state.u + state.v)
        there = self._store + state.added
        return abs(total - there) / there


def _bump(
    points: Floats, centre: Floats, radius: float, room: Floats, total: float, gate: Floats | None = None
) -> Floats:
    """Return a smooth bump (n) about a centre (3) on points that stand for so much room (n), times a gate (n).

    Its total is the given one where the gate is 1.
    """
    far = ((points - centre) ** 2).sum(axis=1)
    nearest = int(np.argmin(far))
    bump: Floats = np.clip(1 - far / radius**2, 0, None) ** 2
    bump[nearest] = max(bump[nearest], 1e-3)
    whole = float(np.sum(room * bump))
    return (bump if gate is None else bump * gate) * (total / whole)
