"""Rot and mould together on one fruit: initial fields, the gate between them, wounds, lags and spawning.

The soft rot lives on the flesh and eats what is in it, the mould lives on the skin and eats what is there; both start
as random fields of one kind (D15). The mould spreads only where rot is (D14). In the cardinal climate both grow as
their species do (`solver.decay.climate`), what lands waits for its lag, and broken skin loses more water.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import Context
from ..climate import flesh_activity, moisture, surface_activity, warmth
from ..environment import air
from ..params import DecayParams
from ..surfaces.surface import Surface
from ..within.joint import Joint, joined
from ..within.water import Water, activity
from .arriving import Arrivals
from .both import Both, rotten_since
from .colony import Colony
from .drawn import fed
from .gate import SHUT, gates
from .layer import Layer, State
from .noise import patches
from .rates import Rates, daily
from .skin import Skin, laid
from .spawning import Landing
from .waiting import Seed

__all__ = ["System"]

#: Radius of a spawned colony [r1], and the share of the map above which a place is taken already.
_SPORE = 0.06
_TAKEN = 0.05
#: Density of what starts to grow after its lag, over d2: a twentieth of the map, which nobody sees yet.
_INOCULUM = 4.0


class System:
    """Everything that decays on one fruit. Without mould the rot is the same, bit by bit, as with it.

    surface: the fruit's own of so many cells, where it has been laid already. inside: points of flesh with fields of
    its own, about; 0: none. dries, damp: what other fruits near by do to its air: evaporation over that of a fruit
    alone, and what they add to its humidity [percent].
    """

    dries = 1.0
    damp = 0.0

    def __init__(
        self, params: DecayParams, cells: int, with_mould: bool, surface: Surface | None = None, inside: int = 0
    ) -> None:
        self.params = params
        self.surface = surface or laid(params, cells)
        self.joint: Joint | None = None
        if params.within is not None and inside:
            # what cuts leave of a fruit has its stone; heat goes through a core
            own = params.mesh is not None and not params.cuts
            fruit = None if own or params.oven is not None else params
            self.joint = joined(self.surface, inside, params.within.skin, fruit, params.flesh.rind)
        self.skin = Skin(params, cells, self.surface)
        self._cardinal = params.climate == "cardinal"
        for_rot, for_mould, *clocks = Context.generator(params.seed).spawn(4)
        self.rot = self._layer(params, "rot", for_rot, self.joint)
        self.mould = self._layer(params, "mould", for_mould) if with_mould else None
        self.arrivals = Arrivals(params, with_mould, clocks)
        self._water = None
        if params.within is not None and self.joint is not None:
            self._water = Water(params, params.within, self.joint, self.skin.extent)
        wet = self._water.fresh if self._water else None
        self.start = Both(self.rot.fresh, self.mould.fresh if self.mould else None, 0.0, wet)
        for seed in (wound._replace(rots=rots) for wound in self.skin.wounds() for rots in self._kinds):
            if self._cardinal:
                self.arrivals.land(0.0, seed)
            else:
                self.start = self._seeded(self.start, 0.0, seed)

    def _layer(
        self, params: DecayParams, name: str, generator: np.random.Generator, joint: Joint | None = None
    ) -> Layer:
        medium = joint or self.surface
        points, size = medium.points, params.patch_size
        fresh = params.nutrient * (1 + params.unevenness * patches(points, size, generator))
        factor = fed(params, self.skin.rays, points)
        fresh = fresh if factor is None else fresh * factor
        coarse = 1 + params.noise * patches(points, size, generator)
        return Layer(medium, daily(getattr(params, name), params, self.skin.radius), fresh, coarse)

    @property
    def _kinds(self) -> tuple[bool, ...]:
        """What lands: rot, and mould where there is one."""
        return (True, False) if self.mould is not None else (True,)

    def _seeded(self, state: Both, day: float, seed: Seed) -> Both:
        """Return the state with a seed that starts to grow on a day."""
        layer = self.rot if seed.rots else self.mould
        assert layer is not None
        here = state.rot if seed.rots else state.mould
        assert here is not None
        gate = None if seed.rots else self.gate(state.rot)
        share = _INOCULUM if self._cardinal else 1.0
        if seed.ray is None or seed.place is None:
            assert self.skin.painted is not None
            map_ = share * self.skin.painted
            grown = layer.painted(here, map_ if gate is None else map_ * gate)
        else:
            self.arrivals.settle(seed.rots, seed.ray, day)
            grown = layer.seeded(here, seed.place, seed.radius, gate, share)
        return state._replace(rot=grown) if seed.rots else state._replace(mould=grown)

    @property
    def imported(self) -> bool:
        """Whether the surface is a mesh of the user's own, whose vertices have the fields."""
        return self.params.mesh is not None

    @property
    def steady(self) -> bool:
        """Whether nothing from outside changes in time."""
        return not self.params.weather

    def gate(self, rot: State) -> Floats:
        """Return where the mould may spread, 0 to 1 (v)."""
        return gates(self.rotten(rot))

    def rotten(self, rot: State) -> Floats:
        """Return the map of the rot on the skin (v)."""
        return self.rot.share(rot)[: len(self.surface.points)]

    def advance(self, state: Both, day: float, dt: float) -> Both:
        """Return the state dt [day] after a day, without new colonies; rot and air are those of the step's middle."""
        middle, params = day + dt / 2, self.params
        flesh: float | Floats = flesh_activity(params, state.water) if self._cardinal else 1.0
        rates, pace = self._rates(params.rot, middle, self.rot.rates), None
        if self._cardinal and state.wet is not None:
            flesh = activity(state.wet)
            pace = np.asarray(moisture(params.rot, flesh))
            flesh = flesh[: len(self.surface.points)]
        elif self._cardinal:
            rates = rates.slowed(float(moisture(params.rot, flesh)))
        rot = self.rot.advance(state.rot, dt, rates=rates, pace=pace)
        before, after = self.rotten(state.rot), self.rotten(rot)
        broken = (self.skin.broken(before) + self.skin.broken(after)) / 2
        water, wet = self._dried(state, broken, day, day + dt)
        since = rotten_since(before, after, state.since, day, dt)
        if self.mould is None or state.mould is None:
            return Both(rot, None, water, wet, None, since)
        ground = (before + after) / 2
        pace = None
        if self._cardinal:
            out = surface_activity(params, middle, flesh, broken, self.damp)
            pace = np.asarray(moisture(params.mould, flesh + params.mould.exposed * (out - flesh)))
        rates = self._rates(params.mould, middle, self.mould.rates)
        return Both(rot, self.mould.advance(state.mould, dt, ground, rates, pace), water, wet, None, since)

    def age(self, state: Both, day: float) -> Floats:
        """Return for how long the skin has been rotten on a day (v) [day], 0 where it is not."""
        if state.since is None:
            return np.zeros(len(self.surface.points))
        return np.maximum(day - state.since, 0.0)

    def _dried(self, state: Both, broken: Floats, start: float, end: float) -> tuple[float, Floats | None]:
        """Return the water lost by the end, with a share (v) of the skin broken, and what is left where."""
        if self._water is None or state.wet is None:
            lost = self.skin.evaporated(broken, start, end, self.dries)
            return min(state.water + lost, self.params.water_content / 100), None
        wet = self._water.advance(state.wet, broken, start, end, self.dries)
        return self._water.lost(wet), wet

    def _rates(self, colony: Colony, day: float, steady: Rates) -> Rates:
        return daily(colony, self.params, self.skin.radius, day) if self.params.weather else steady

    def conductance(self, rot: State) -> float:
        """Return the mean conductance of the whole skin, rotten places and wounds among it [g/(m2 s MPa)]."""
        return self.skin.conductance(self.skin.broken(self.rotten(rot)))

    def caught(self, day: float, ray: Floats, radius: float) -> None:
        """Let rot, and the mould if there is one, land on a day at a unit direction: a fruit that touches there."""
        self.arrivals.again()
        for rots in self._kinds:
            self.arrivals.land(day, Seed(rots, ray, self.skin.place(ray), radius))

    def taken_by(self, rot: Colony, mould: Colony) -> None:
        """Let another species live on a fruit that is sound until now."""
        self.params = self.params.model_copy(update={"rot": rot, "mould": mould})
        for layer, colony in ((self.rot, rot), (self.mould, mould)):
            if layer is not None:
                layer.taken_by(daily(colony, self.params, self.skin.radius))
        self.arrivals.live_on(self.params)

    def distance(self, a: Both, b: Both) -> float:
        """Return the largest relative L2 difference of density u + v between two states, of rot and of mould."""
        worst = 0.0
        for layer, x, y in zip((self.rot, self.mould), a[:2], b[:2], strict=True):
            if layer is None or x is None or y is None:
                continue
            medium, there = layer.surface, y.u + y.v
            size = medium.total(there**2)
            if size > 0:
                gap = x.u + x.v - there
                worst = max(worst, float(np.sqrt(medium.total(gap**2) / size)))
        return worst

    def next_root(self, state: Both, until: float) -> float:
        """Return when the next seed starts to grow [day], infinite if none does before `until`.

        Whether a spore will is judged on the state at the start of the step it lands in, so that the many that land on
        barren or taken ground cost no step.
        """

        def rooted(landing: Landing, rots: bool) -> Seed | None:
            if not self._roots(state, landing, self.skin.nearest(landing.direction), rots):
                return None
            return Seed(rots, landing.direction, self.skin.place(landing.direction), _SPORE)

        return self.arrivals.next(until, rooted)

    def root(self, state: Both) -> Both:
        """Return the state with the colony that is due."""
        return self._seeded(state, *self.arrivals.pop())

    def _roots(self, state: Both, landing: Landing, site: int, rots: bool) -> bool:
        rotten = float(self.rot.share(state.rot)[site])
        # colonies that grow slowly seed slowly
        chance = self._growing(rots, landing.day)
        if rots:
            return rotten < _TAKEN and landing.mark < chance
        assert self.mould is not None
        assert state.mould is not None
        chance *= rotten if landing.stray else 1.0
        return rotten > SHUT and landing.mark < chance and float(self.mould.share(state.mould)[site]) < _TAKEN

    def _growing(self, rots: bool, day: float) -> float:
        if not self._cardinal:
            return 1.0
        return float(warmth(self.params.rot if rots else self.params.mould, air(self.params, day)[0]))
