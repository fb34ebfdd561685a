"""The fruit's body on one fruit: from water lost and rot on the skin to the shape it settles to, stage by stage.

Every stage is settled from the evenly shrunk fresh shape, so that it does not depend on the stages before it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from ...arrays import Floats
from ...contract import InvalidInput, NotConverged
from ...fruit import lattice
from ..environment import reference_radius
from ..params import DecayParams
from ..surfaces.surface import Surface
from ..within.inner import Held
from .embedded import Embedded
from .equilibrium import Balance, rested, settle
from .filling import Filling, Round
from .flesh import Softened, softened
from .loads import Loads
from .material import blocks, energy
from .newton import skin_areas
from .obstacles import Obstacles
from .pressure import pressed
from .springs import knit, swung

__all__ = ["CONTACT", "DENSITY", "Body"]


#: Density of fresh fruit [kg/m^3].
DENSITY = 1000.0
#: Stiffness of the floor per area, over the fresh modulus and an edge: it gives way by a thousandth of r1.
CONTACT = 30.0
#: Stiffness per volume of the springs that keep the core from sliding, over the fresh modulus.
_TETHER = 0.1
#: Neighbours farther from the fresh skin than this are never met; one may stand so deep in it [r1].
_REACH, _DEEP = 1.0, 0.3
#: Parts of the way from fresh to dried flesh, in powers of lengths and stiffness, by which a hard case is led.
_PARTS = (0.25, 0.5, 0.75, 1.0)
#: Radius of a ball that stands for a plane [r1].
_PLANE = 1e4


class Body:
    """Tetrahedra of one fruit under a surface of so many `cells`; tolerance: of the out-of-balance force.

    radius: r1 [m]. core (p): which points springs keep from sliding.

    Raises:
        InvalidInput: a neighbour stands in the fruit.

    """

    def __init__(self, params: DecayParams, surface: Surface, cells: int, layers: int, tolerance: float) -> None:
        self._params, self._surface = params, surface
        own = params.mesh is not None
        self._filling: Filling = Embedded(params, surface, layers) if own else Round(params, cells, layers)
        self.solid = self._filling.solid
        self._cells = cells
        self._tolerance = tolerance
        self._pattern = blocks(self.solid.tets, len(self.solid.points))
        r1 = reference_radius(params, self._filling.extent)
        self._balls = _balls(params, self._filling)
        self._pressure, self._inertia = DENSITY * params.flesh.gravity * r1, DENSITY * r1**2
        self.radius, self.core = r1, self._filling.core

    def state(self, water: float, rot: Floats | None, held: Held | None = None) -> Softened:
        """Return the flesh after a share of the weight has gone as water; rot: on the surface's vertices (v).

        held: what flesh with fields of its own has on the body's points; else rot fades out below the skin.
        """
        solid, flesh = self.solid, self._params.flesh
        inside, gives = np.zeros(len(solid.tets)), None
        if held is not None:
            inside = held.rot[solid.tets].mean(axis=1)
            gives = np.maximum(1 - held.wet[solid.tets].mean(axis=1), 0.0)
        elif rot is not None:
            at = self._filling.inwards @ rot * np.clip(1 - solid.depth / flesh.rot_depth, 0, 1)
            inside = at[solid.tets].mean(axis=1)
        fleshy = float(solid.volume[~solid.stone].sum() / solid.volume.sum())
        wet = self._params.water_content / 100 / fleshy
        state = softened(flesh, self._params.firmness, water, inside, solid.stone, solid.volume, wet, gives)
        return pressed(state, self._params, solid)

    def settled(
        self,
        state: Softened,
        near: Balance | None = None,
        watch: Callable[[], None] = lambda: None,
        earlier: Balance | None = None,
    ) -> Balance:
        """Return the shape that the flesh settles to, from a shape `near` it or from the evenly shrunk fresh one.

        earlier: the shape as long before `near` as the wanted one comes after it: it starts from where both point to,
        if no tetrahedron is inverted there.

        Raises:
            NotConverged: it does not.
            Unstable: the paper's springs need shorter steps.

        """
        try:
            return self._from(state, near, watch, earlier)
        except NotConverged:
            if self._params.body == "paper":
                raise
        # flesh that dries far onto a stone is crushed at once by the even shape: it is led there by less dried ones
        fresh, found = self.state(0.0, None), None
        for part in _PARTS:
            lengths = fresh.shrinkage ** (1 - part) * state.shrinkage**part
            young = fresh.young ** (1 - part) * state.young**part
            found = self._from(state._replace(shrinkage=lengths, young=young), found, watch)
        assert found is not None
        return found

    def _from(
        self, state: Softened, near: Balance | None, watch: Callable[[], None], earlier: Balance | None = None
    ) -> Balance:
        solid, fresh = self.solid, self._params.flesh.unit * self._params.firmness
        rest = rested(solid.points, solid.tets, state.shrinkage, state.young, self._params.flesh.poisson)
        even = float(np.cbrt(np.average(state.shrinkage**3, weights=solid.volume)))
        middle = self._filling.middle
        start = middle + even * (solid.points - middle)
        loads = self._loads(state, start, fresh)
        if near is not None:
            start = middle + (near.points - middle) * even / near.even
            before = start if earlier is None else middle + (earlier.points - middle) * even / earlier.even
            ahead = 2 * start - before
            start = ahead if np.isfinite(energy(ahead, *rest)) else start
        if self._params.body == "paper":
            network = knit(solid, state, self._inertia)
            found = swung(solid, start, network, loads, self._params.swing, watch)
            return found._replace(even=even, booked=state.booked, dried=state.dried)
        found = settle(start, rest, loads, self._pattern, self._tolerance, watch)
        return found._replace(even=even, booked=state.booked, dried=state.dried)

    @property
    def obstacles(self) -> Obstacles:
        """What it rests on: the floor, unless a neighbour carries it, and the neighbours; nothing without a weight."""
        if self._pressure == 0:
            return Obstacles(None, np.empty((0, 4)))
        return Obstacles(None if self._filling.carried else self._filling.floor, self._balls)

    def _loads(self, state: Softened, start: Floats, fresh: float) -> Loads:
        solid, count = self.solid, len(self.solid.points)
        zero = np.zeros(count)
        if self._pressure == 0:
            return Loads(zero, None, zero, zero, start)
        shared = np.repeat(solid.volume / 4, 4)
        mass: Floats = np.bincount(solid.tets.ravel(), shared * np.repeat(state.mass, 4), count).astype(float)
        contact = skin_areas(solid)
        contact *= CONTACT * fresh / float(np.cbrt(solid.volume.mean()))
        volume = np.bincount(solid.tets.ravel(), shared, count)
        tether = np.where(self._filling.core, _TETHER * fresh * volume, 0.0)
        # a fruit that lies on another one does not reach the floor
        floor = self.obstacles.floor
        heights = None if floor is None else floor - self._filling.hanging
        return Loads(self._pressure * mass, heights, contact, tether, start, self._balls)

    def on_lattice(self, balance: Balance, resolution: int) -> Floats:
        """Return the displacement of the outer surface (n, 2 n, 3) on the common lattice."""
        even, rest = self.parted(balance)
        fresh = self._params.surface(*lattice(resolution))
        found: Floats = even * fresh + (self._filling.outwards(resolution) @ rest).reshape(fresh.shape)
        return found

    def on_surface(self, balance: Balance) -> Floats:
        """Return the displacement of the surface's vertices (v, 3)."""
        even, rest = self.parted(balance)
        found: Floats = even * self._surface.points + self.onto(self._cells) @ rest
        return found

    def onto(self, cells: int) -> sparse.csr_array:
        """Return the matrix that takes a field (s) of the body's skin to a sphere of so many cells, or to the mesh."""
        return self._filling.onto(cells)

    def parted(self, balance: Balance) -> tuple[float, Floats]:
        """Return the even part of the skin's displacement, over its place, and the rest (s, 3), which is interpolated.

        Facets would take the even part as shrinking chords; taken apart, a fruit that shrinks evenly stays exact.
        """
        return self.parted_of(balance.points)

    def parted_of(self, points: Floats) -> tuple[float, Floats]:
        """Return the same of points (p, 3) of the body, in its own frame."""
        skin = self.solid.skin
        fresh, moved = self.solid.points[skin], (points - self.solid.points)[skin]
        about = fresh - fresh.mean(axis=0)
        even = float(np.sum(about * moved) / np.sum(about * about))
        return even, moved - even * fresh


def _balls(params: DecayParams, filling: Filling) -> Floats:
    """Return centres and radii (b, 4) of the balls that the fruit can meet in place of its neighbours."""
    found = []
    for number, other in enumerate(params.neighbours):
        away = filling.gap(other)
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
