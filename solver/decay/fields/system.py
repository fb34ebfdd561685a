"""Rot and mould together on one fruit: initial fields, the gate between them, wounds, lags and spawning.

The soft rot lives on the flesh and eats what is in it, the mould lives on the skin and eats what is there; both start
as random fields of one kind (D15). The mould spreads only where rot is (D14). In the cardinal climate both grow as
their species do (`solver.decay.climate`), what lands waits for its lag, and broken skin loses more water.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...arrays import Floats, Ints
from ...contract import Context
from ...fruit import directions
from ..climate import flesh_activity, moisture, surface_activity, warmth
from ..environment import air, evaporated, opened, reference_radius
from ..params import DecayParams
from ..surfaces.cut import bare
from ..surfaces.imported import extent_of
from ..surfaces.seeds import seeds
from ..surfaces.surface import Surface, extent, geodesic, lay, triangulated
from ..within.joint import Joint, joined
from ..within.roast import Roasted
from ..within.water import Water, activity
from .arriving import Arrivals
from .colony import Colony
from .drawn import fed, opened_skin, seen
from .gate import SHUT, gates
from .layer import Layer, State
from .noise import patches
from .rates import Rates, daily
from .spawning import Landing
from .waiting import Seed

__all__ = ["ROTTEN", "Both", "System", "laid"]

#: Map value from which a place counts as rotten.
ROTTEN = 0.1

#: Radius of a spawned colony [r1], and the share of the map above which a place is taken already.
_SPORE = 0.06
_TAKEN = 0.05
#: Density of what starts to grow after its lag, over d2: a twentieth of the map, which nobody sees yet.
_INOCULUM = 4.0


class Both(NamedTuple):
    """State of the rot, of the mould if there is one, and the water that has evaporated, over the fresh weight.

    wet (n): of flesh with fields of its own, its water over the fresh one's, skin first. roasted: what an oven made of
    it. since (v): the day on which the skin was rotten first, infinite where it is not; None is nowhere.
    """

    rot: State
    mould: State | None
    water: float = 0.0
    wet: Floats | None = None
    roasted: Roasted | None = None
    since: Floats | None = None


def laid(params: DecayParams, cells: int) -> Surface:
    """Return what everything grows on: the imported mesh, or the fruit's own surface of so many cells.

    Raises:
        InvalidGeometry: the mesh has points that no triangle of positive area touches.

    """
    if params.mesh is None:
        return lay(params, cells)
    return triangulated(np.array(params.mesh.points, float), np.array(params.mesh.faces, np.int64))


class System:
    """Everything that decays on one fruit. Without mould the rot is the same, bit by bit, as with it.

    bare (v): where cuts left flesh without a skin.
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
        self.bare = bare(params.cuts, self.surface.points)
        self._rays = geodesic(cells)[0] if params.mesh is None else seen(params, self.surface.points)
        self._tree = KDTree(self._rays)
        self._painted = opened_skin(params, self._rays)
        closed = extent_of(self.surface) if params.mesh is not None else None
        self.extent = closed or extent(params)
        self._radius = 1e3 * reference_radius(params, self.extent)
        self._cardinal = params.climate == "cardinal"
        for_rot, for_mould, *clocks = Context.generator(params.seed).spawn(4)
        self.rot = self._layer(params, "rot", for_rot, self.joint)
        self.mould = self._layer(params, "mould", for_mould) if with_mould else None
        self.arrivals = Arrivals(params, with_mould, clocks)
        self._wounds = self._opened()
        self._water = None
        if params.within is not None and self.joint is not None:
            self._water = Water(params, params.within, self.joint, self.extent)
        wet = self._water.fresh if self._water else None
        self.start = Both(self.rot.fresh, self.mould.fresh if self.mould else None, 0.0, wet)
        for seed in self._wounding():
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
        factor = fed(params, self._rays, points)
        fresh = fresh if factor is None else fresh * factor
        coarse = 1 + params.noise * patches(points, size, generator)
        return Layer(medium, daily(getattr(params, name), params, self._radius), fresh, coarse)

    def _wounding(self) -> Iterator[Seed]:
        """Yield what the wounds bring: rot, and mould where there is one."""
        kinds = (True, False) if self.mould is not None else (True,)
        for wound in seeds(self.params):
            ray = directions(*np.radians([wound.colatitude, wound.azimuth]))
            if wound.vertex is not None:
                ray = self._rays[wound.vertex]
            centre = self._place(ray) if wound.vertex is None else self.surface.points[wound.vertex]
            for rots in kinds:
                yield Seed(rots, ray, centre, wound.radius)
        if self._painted is not None:
            for rots in kinds:
                yield Seed(rots, None, None, 0.0)

    def _opened(self) -> Floats:
        """Return where wounds and cuts have broken the skin on day 0, 0 to 1 (v)."""
        found = self.bare.astype(float)
        for seed in self._wounding():
            if seed.place is None:
                assert self._painted is not None
                found = np.maximum(found, self._painted)
            else:
                far = ((self.surface.points - seed.place) ** 2).sum(axis=1)
                found = np.maximum(found, np.clip(1 - far / seed.radius**2, 0, None) ** 2)
        return found

    def _seeded(self, state: Both, day: float, seed: Seed) -> Both:
        """Return the state with a seed that starts to grow on a day."""
        layer = self.rot if seed.rots else self.mould
        assert layer is not None
        here = state.rot if seed.rots else state.mould
        assert here is not None
        gate = None if seed.rots else self.gate(state.rot)
        share = _INOCULUM if self._cardinal else 1.0
        if seed.ray is None or seed.place is None:
            assert self._painted is not None
            map_ = share * self._painted
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
        broken = [self.broken(x) for x in (state.rot, rot)]
        water, wet = self._dried(state, (broken[0] + broken[1]) / 2, day, day + dt)
        since = self._since(state, rot, day, dt)
        if self.mould is None or state.mould is None:
            return Both(rot, None, water, wet, None, since)
        ground = (self.rotten(state.rot) + self.rotten(rot)) / 2
        pace = None
        if self._cardinal:
            out = surface_activity(params, middle, flesh, (broken[0] + broken[1]) / 2, self.damp)
            pace = np.asarray(moisture(params.mould, flesh + params.mould.exposed * (out - flesh)))
        rates = self._rates(params.mould, middle, self.mould.rates)
        return Both(rot, self.mould.advance(state.mould, dt, ground, rates, pace), water, wet, None, since)

    def age(self, state: Both, day: float) -> Floats:
        """Return for how long the skin has been rotten on a day (v) [day], 0 where it is not."""
        if state.since is None:
            return np.zeros(len(self.surface.points))
        return np.maximum(day - state.since, 0.0)

    def _since(self, state: Both, rot: State, day: float, dt: float) -> Floats | None:
        """Return since when the skin is rotten, after a step: it became so evenly within it."""
        before, after = self.rotten(state.rot), self.rotten(rot)
        newly = (after >= ROTTEN) if state.since is None else (after >= ROTTEN) & np.isinf(state.since)
        if not newly.any():
            return state.since
        since = np.full(len(after), np.inf) if state.since is None else state.since.copy()
        rise = np.maximum(after - before, 1e-300)
        since[newly] = day + dt * np.clip((ROTTEN - before) / rise, 0.0, 1.0)[newly]
        return since

    def _dried(self, state: Both, broken: Floats, start: float, end: float) -> tuple[float, Floats | None]:
        """Return the water lost by the end, with a share (v) of the skin broken, and what is left where."""
        if self._water is None or state.wet is None:
            return self._evaporated(state.water, broken, start, end), None
        wet = self._water.advance(state.wet, broken, start, end, self.dries)
        return self._water.lost(wet), wet

    def _rates(self, colony: Colony, day: float, steady: Rates) -> Rates:
        return daily(colony, self.params, self._radius, day) if self.params.weather else steady

    def broken(self, rot: State) -> Floats:
        """Return where the skin is rotten or wounded, 0 to 1 (v)."""
        return np.maximum(self.rotten(rot), self._wounds)

    def _evaporated(self, before: float, broken: Floats, start: float, end: float) -> float:
        """Return the water lost by the end, with a share (v) of the skin broken meanwhile."""
        params = self.params
        skin = params.transpiration + (opened(params) - params.transpiration) * self.surface.mean(broken)
        lost = skin * evaporated(params, self.extent, start, end) * self.dries
        return min(before + lost, params.water_content / 100)

    def conductance(self, rot: State) -> float:
        """Return the mean conductance of the whole skin, rotten places and wounds among it [g/(m2 s MPa)]."""
        params = self.params
        more = opened(params) - params.transpiration
        return params.transpiration + more * self.surface.mean(self.broken(rot))

    def caught(self, day: float, ray: Floats, radius: float) -> None:
        """Let rot, and the mould if there is one, land on a day at a unit direction: a fruit that touches there."""
        self.arrivals.again()
        for rots in (True, False) if self.mould is not None else (True,):
            self.arrivals.land(day, Seed(rots, ray, self._place(ray), radius))

    def taken_by(self, rot: Colony, mould: Colony) -> None:
        """Let another species live on a fruit that is sound until now."""
        self.params = self.params.model_copy(update={"rot": rot, "mould": mould})
        for layer, colony in ((self.rot, rot), (self.mould, mould)):
            if layer is not None:
                layer.taken_by(daily(colony, self.params, self._radius))
        self.arrivals.live_on(self.params)

    def near(self, ray: Floats, radius: float) -> Ints:
        """Return the vertices within a distance on the unit sphere of a direction, the nearest one among them."""
        found = self._tree.query_ball_point(ray, radius)
        return np.array(sorted({*found, int(self._tree.query(ray)[1])}))

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
            if not self._roots(state, landing, int(self._tree.query(landing.direction)[1]), rots):
                return None
            return Seed(rots, landing.direction, self._place(landing.direction), _SPORE)

        return self.arrivals.next(until, rooted)

    def root(self, state: Both) -> Both:
        """Return the state with the colony that is due."""
        return self._seeded(state, *self.arrivals.pop())

    def _place(self, ray: Floats) -> Floats:
        """Return the point (3) of the skin in a unit direction; of an imported mesh the vertex nearest to it."""
        if self.params.mesh is not None:
            return np.asarray(self.surface.points[int(self._tree.query(ray)[1])])
        x, y, z = ray
        return self.params.surface(np.arccos(np.clip(y, -1, 1)), np.arctan2(z, x))

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
