"""Rot and mould together on one fruit: initial fields, the gate between them, wounds and spawning.

The soft rot lives on the flesh and eats what is in it, the mould lives on the skin and eats what is there; both start
as random fields of one kind (D15). The mould spreads only where rot is (D14).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...arrays import Floats
from ...contract import Context
from ...fruit import directions
from ..params import DecayParams
from ..surfaces.imported import rays_from
from ..surfaces.places import painted
from ..surfaces.seeds import seeds
from ..surfaces.surface import Surface, geodesic, lay, triangulated
from .colony import Colony
from .gate import SHUT, gates
from .layer import Layer, State
from .noise import patches
from .rates import Rates, daily
from .spawning import Landing, Spawner

__all__ = ["Both", "System", "laid"]


#: Radius of a spawned colony [r1], and the share of the map above which a place is taken already.
_SPORE = 0.06
_TAKEN = 0.05


class Both(NamedTuple):
    """State of the rot, and of the mould if there is one."""

    rot: State
    mould: State | None


class _Due(NamedTuple):
    """A spore that will take root, and whether it is rot."""

    landing: Landing
    rots: bool


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

    surface: the fruit's own of so many cells, where it has been laid already.
    """

    def __init__(self, params: DecayParams, cells: int, with_mould: bool, surface: Surface | None = None) -> None:
        self._params = params
        self.surface = surface or laid(params, cells)
        self._rays = geodesic(cells)[0] if params.mesh is None else rays_from(self.surface.points)
        self._tree = KDTree(self._rays)
        for_rot, for_mould, rot_clocks, mould_clocks = Context.generator(params.seed).spawn(4)
        chance = params.spawning / (10 - params.propagation_rate)
        self.rot = self._layer(params, "rot", for_rot)
        self._rot_spawner = Spawner(chance, 0.0, params.spawn_reach, rot_clocks)
        self.mould = self._layer(params, "mould", for_mould) if with_mould else None
        strays = params.rot_spawning if with_mould else 0.0
        self._mould_spawner = Spawner(chance, strays, params.spawn_reach, mould_clocks)
        self._due: _Due | None = None
        self.start = self._wounded(params)

    def _layer(self, params: DecayParams, name: str, generator: np.random.Generator) -> Layer:
        points, size = self.surface.points, params.patch_size
        fresh = params.nutrient * (1 + params.unevenness * patches(points, size, generator))
        coarse = 1 + params.noise * patches(points, size, generator)
        return Layer(self.surface, daily(getattr(params, name), params), fresh, coarse)

    def _wounded(self, params: DecayParams) -> Both:
        rot, mould = self.rot.fresh, self.mould.fresh if self.mould else None
        for wound in seeds(params):
            ray = directions(*np.radians([wound.colatitude, wound.azimuth]))
            if wound.vertex is not None:
                ray = self._rays[wound.vertex]
            centre = self._place(ray) if wound.vertex is None else self.surface.points[wound.vertex]
            rot = self.rot.seeded(rot, centre, wound.radius)
            self._rot_spawner.settle(ray, 0.0)
            if self.mould is not None and mould is not None:
                mould = self.mould.seeded(mould, centre, wound.radius, self.gate(rot))
                self._mould_spawner.settle(ray, 0.0)
        if params.wound_map:
            share = painted(params.wound_map, self._rays)
            rot = self.rot.painted(rot, share)
            if self.mould is not None and mould is not None:
                mould = self.mould.painted(mould, share * self.gate(rot))
        return Both(rot, mould)

    @property
    def imported(self) -> bool:
        """Whether the surface is a mesh of the user's own, whose vertices have the fields."""
        return self._params.mesh is not None

    @property
    def steady(self) -> bool:
        """Whether nothing from outside changes in time."""
        return not self._params.weather

    def gate(self, rot: State) -> Floats:
        """Return where the mould may spread, 0 to 1 (v)."""
        return gates(self.rot.share(rot))

    def advance(self, state: Both, day: float, dt: float) -> Both:
        """Return the state dt [day] after a day, without new colonies; rot and air are those of the step's middle."""
        rot = self.rot.advance(state.rot, dt, rates=self._rates(self._params.rot, day + dt / 2))
        if self.mould is None or state.mould is None:
            return Both(rot, None)
        ground = (self.rot.share(state.rot) + self.rot.share(rot)) / 2
        rates = self._rates(self._params.mould, day + dt / 2)
        return Both(rot, self.mould.advance(state.mould, dt, ground, rates))

    def _rates(self, colony: Colony, day: float) -> Rates | None:
        return daily(colony, self._params, day) if self._params.weather else None

    def distance(self, a: Both, b: Both) -> float:
        """Return the largest relative L2 difference of density u + v between two states, of rot and of mould."""
        worst = 0.0
        for x, y in zip(a, b, strict=True):
            if x is None or y is None:
                continue
            there = y.u + y.v
            size = self.surface.total(there**2)
            if size > 0:
                gap = x.u + x.v - there
                worst = max(worst, float(np.sqrt(self.surface.total(gap**2) / size)))
        return worst

    def next_root(self, state: Both, until: float) -> float:
        """Return when the next spore takes root [day], infinite if none does before `until`.

        Whether it will is judged on the state at the start of the step it falls in, so that the many that land on
        barren or taken ground cost no step.
        """
        while self._due is None:
            first = self._rot_spawner if self._rot_spawner.next <= self._mould_spawner.next else self._mould_spawner
            if first.next > until:
                return np.inf
            landing = first.land()
            site = int(self._tree.query(landing.direction)[1])
            if self._roots(state, landing, site, first is self._rot_spawner):
                self._due = _Due(landing, first is self._rot_spawner)
        return self._due.landing.day

    def root(self, state: Both) -> Both:
        """Return the state with the colony that is due."""
        assert self._due is not None
        landing, rots = self._due
        self._due = None
        place = self._place(landing.direction)
        if rots:
            self._rot_spawner.settle(landing.direction, landing.day)
            return state._replace(rot=self.rot.seeded(state.rot, place, _SPORE))
        assert self.mould is not None
        assert state.mould is not None
        self._mould_spawner.settle(landing.direction, landing.day)
        return state._replace(mould=self.mould.seeded(state.mould, place, _SPORE, self.gate(state.rot)))

    def _place(self, ray: Floats) -> Floats:
        """Return the point (3) of the skin in a unit direction; of an imported mesh the vertex nearest to it."""
        if self._params.mesh is not None:
            return np.asarray(self.surface.points[int(self._tree.query(ray)[1])])
        x, y, z = ray
        return self._params.surface(np.arccos(np.clip(y, -1, 1)), np.arctan2(z, x))

    def _roots(self, state: Both, landing: Landing, site: int, rots: bool) -> bool:
        rotten = float(self.rot.share(state.rot)[site])
        if rots:
            return rotten < _TAKEN
        assert self.mould is not None
        assert state.mould is not None
        chance = rotten if landing.stray else 1.0
        return rotten > SHUT and landing.mark < chance and float(self.mould.share(state.mould)[site]) < _TAKEN
