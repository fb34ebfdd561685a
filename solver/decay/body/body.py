"""The fruit's body on one fruit: from water lost and rot on the skin to the shape it settles to, stage by stage.

Every stage is settled from the evenly shrunk fresh shape, so that it does not depend on the stages before it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import sparse

from ...arrays import Floats, Ints
from ...contract import InvalidInput
from ...fruit import directions, lattice
from ..environment import reference_radius
from ..params import DecayParams
from ..surfaces.seeds import carried, gap
from ..surfaces.surface import Surface, extent, geodesic, shares_at
from .equilibrium import Balance, rested, settle
from .flesh import Softened, softened
from .loads import Loads
from .material import blocks
from .pressure import pressed
from .solid import ball, fill
from .springs import knit, swung

__all__ = ["Body"]


#: Density of fresh fruit [kg/m^3].
_DENSITY = 1000.0
#: Stiffness of the floor per area, over the fresh modulus and an edge: it gives way by a thousandth of r1.
_FLOOR = 30.0
#: Stiffness per volume of the springs that keep the core from sliding, over the fresh modulus; how far the core goes.
_TETHER, _CORE = 0.1, 0.5
#: Neighbours farther from the fresh skin than this are never met; one may stand so deep in it [r1].
_REACH, _DEEP = 1.0, 0.3
#: Radius of a ball that stands for a plane [r1].
_PLANE = 1e4


class Body:
    """Tetrahedra of one fruit under a surface of so many `cells`; tolerance: of the out-of-balance force.

    Raises:
        InvalidInput: a neighbour stands in the fruit.

    """

    def __init__(self, params: DecayParams, surface: Surface, cells: int, layers: int, tolerance: float) -> None:
        self._params = params
        self.solid = fill(params, layers)
        self._surface = surface
        self._cells, self._layers = cells, layers
        self._tolerance = tolerance
        self._pattern = blocks(self.solid.tets, len(self.solid.points))
        r1 = reference_radius(params, extent(params))
        self._balls, self._carried = _balls(params), carried(params)
        self._pressure, self._inertia = _DENSITY * params.flesh.gravity * r1, _DENSITY * r1**2

    def state(self, water: float, rot: Floats | None) -> Softened:
        """Return the flesh after a share of the weight has gone as water; rot: on the surface's vertices (v)."""
        solid, flesh = self.solid, self._params.flesh
        inside = np.zeros(len(solid.tets))
        if rot is not None:
            at = _inwards(self._cells, self._layers) @ rot * np.clip(1 - solid.depth / flesh.rot_depth, 0, 1)
            inside = at[solid.tets].mean(axis=1)
        state = softened(flesh, self._params.firmness, water, inside, solid.stone)
        return pressed(state, self._params, solid)

    def settled(
        self, state: Softened, near: Balance | None = None, watch: Callable[[], None] = lambda: None
    ) -> Balance:
        """Return the shape that the flesh settles to, from a shape `near` it or from the evenly shrunk fresh one.

        Raises:
            NotConverged: it does not.
            Unstable: the paper's springs need shorter steps.

        """
        solid, fresh = self.solid, self._params.flesh.unit * self._params.firmness
        rest = rested(solid.points, solid.tets, state.shrinkage, state.young, self._params.flesh.poisson)
        even = float(np.cbrt(np.average(state.shrinkage**3, weights=solid.volume)))
        start = even * solid.points
        loads = self._loads(state, start, fresh)
        if near is not None:
            start = near.points * even / near.even
        if self._params.body == "paper":
            network = knit(solid, state, self._inertia)
            return swung(solid, start, network, loads, self._params.swing, watch)._replace(even=even)
        found = settle(start, rest, loads, self._pattern, self._tolerance, watch)
        return found._replace(even=even)

    def _loads(self, state: Softened, start: Floats, fresh: float) -> Loads:
        solid, count = self.solid, len(self.solid.points)
        zero = np.zeros(count)
        if self._pressure == 0:
            return Loads(zero, None, zero, zero, start)
        shared = np.repeat(solid.volume / 4, 4)
        mass: Floats = np.bincount(solid.tets.ravel(), shared * np.repeat(state.mass, 4), count).astype(float)
        corners = solid.points[solid.skin[solid.faces]]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        contact = zero.copy()
        contact[solid.skin] = np.bincount(solid.faces.ravel(), np.repeat(areas / 3, 3), len(solid.skin))
        contact *= _FLOOR * fresh / float(np.cbrt(solid.volume.mean()))
        core = np.linalg.norm(solid.points, axis=1) < _CORE
        volume = np.bincount(solid.tets.ravel(), shared, count)
        tether = np.where(core, _TETHER * fresh * volume, 0.0)
        # a fruit that lies on another one does not reach the floor
        floor = None if self._carried else float(solid.points[:, 1].min())
        return Loads(self._pressure * mass, floor, contact, tether, start, self._balls)

    def on_lattice(self, balance: Balance, resolution: int) -> Floats:
        """Return the displacement of the outer surface (n, 2 n, 3) on the common lattice."""
        even, rest = self.parted(balance)
        fresh = self._params.surface(*lattice(resolution))
        found: Floats = even * fresh + (_outwards(self._layers, resolution) @ rest).reshape(fresh.shape)
        return found

    def on_surface(self, balance: Balance) -> Floats:
        """Return the displacement of the surface's vertices (v, 3)."""
        even, rest = self.parted(balance)
        found: Floats = even * self._surface.points + self.onto(self._cells) @ rest
        return found

    def onto(self, cells: int) -> sparse.csr_array:
        """Return the matrix that takes a field (s) of the body's skin to the vertices of a sphere of so many cells."""
        return _onto(cells, self._layers)

    def parted(self, balance: Balance) -> tuple[float, Floats]:
        """Return the even part of the skin's displacement, over its place, and the rest (s, 3), which is interpolated.

        Facets would take the even part as shrinking chords; taken apart, a fruit that shrinks evenly stays exact.
        """
        skin = self.solid.skin
        fresh, moved = self.solid.points[skin], (balance.points - self.solid.points)[skin]
        about = fresh - fresh.mean(axis=0)
        even = float(np.sum(about * moved) / np.sum(about * about))
        return even, moved - even * fresh


def _balls(params: DecayParams) -> Floats:
    """Return centres and radii (b, 4) of the balls that the fruit can meet in place of its neighbours."""
    found = []
    for number, other in enumerate(params.neighbours):
        away = gap(params, other)
        if away < -_DEEP:
            raise InvalidInput(
                f"neighbour {number} stands {-away:.2f} r1 deep in the fruit.",
                advice=f"Move it away until no more than {_DEEP:g} r1 overlap, or take body=none.",
            )
        if other.gives:
            # a plane is a ball so large that it does not bend
            towards = np.array(other.position) / np.linalg.norm(other.position)
            midway = float(np.linalg.norm(other.position)) - other.radius - away / 2
            found.append((*((midway + _PLANE) * towards), _PLANE))
        elif away < _REACH:
            found.append((*other.position, other.radius))
    return np.array(found).reshape(-1, 4)


def _skin(layers: int) -> tuple[Floats, Ints]:
    rays, _, _, skin, faces = ball(layers)
    return rays[skin], faces


@lru_cache(maxsize=4)
def _inwards(cells: int, layers: int) -> sparse.csr_array:
    """Return the matrix that takes a field of the surface to the body's points, along rays."""
    rays = ball(layers)[0].copy()
    rays[~rays.any(axis=1)] = (0.0, 1.0, 0.0)  # the centre has no ray, and lies too deep for one
    return shares_at(*geodesic(cells), rays)


@lru_cache(maxsize=4)
def _outwards(layers: int, resolution: int) -> sparse.csr_array:
    return shares_at(*_skin(layers), directions(*lattice(resolution)).reshape(-1, 3))


@lru_cache(maxsize=4)
def _onto(cells: int, layers: int) -> sparse.csr_array:
    return shares_at(*_skin(layers), geodesic(cells)[0])
