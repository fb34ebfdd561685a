"""What fills a surface: the tetrahedra of a round fruit, and how fields pass between them and the surface."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy import sparse

from ...arrays import Bools, Floats, Ints
from ...fruit import directions, lattice
from ..params import DecayParams
from ..surfaces.places import Neighbour
from ..surfaces.seeds import carried, gap
from ..surfaces.surface import Extent, extent, geodesic, shares_at
from .solid import Solid, ball, fill

__all__ = ["Filling", "Round"]

#: How far the core goes that is kept from sliding [r1].
_CORE = 0.5


class Filling(Protocol):
    """Tetrahedra under a surface.

    inwards (p, v): takes a field of the surface to the body's points. core (p): what is kept from sliding. extent: area
    and volume of the surface. carried: whether it lies on a neighbour. floor: height of the surface's lowest point
    [r1]; hanging (p): how far what it stands for reaches below each point, negative where it does [r1].
    middle (3): about what it shrinks [r1].
    """

    solid: Solid
    inwards: sparse.csr_array
    core: Bools
    extent: Extent
    carried: bool
    floor: float
    hanging: Floats
    middle: Floats

    def onto(self, cells: int) -> sparse.csr_array:
        """Return the matrix that takes a field of the body's skin (s) to the surface of so many cells."""

    def outwards(self, resolution: int) -> sparse.csr_array:
        """Return the matrix that takes a field of the body's skin (s) to the common lattice."""

    def gap(self, other: Neighbour) -> float:
        """Return how far the fresh surface is from a neighbour [r1]."""


class Round:
    """A fruit whose centre sees all of it, in so many shells, under a surface of so many cells."""

    def __init__(self, params: DecayParams, cells: int, layers: int) -> None:
        self._params, self._layers = params, layers
        self.solid = fill(params, layers)
        self.inwards = _inwards(cells, layers)
        self.core = np.linalg.norm(self.solid.points, axis=1) < _CORE
        self.extent, self.carried = extent(params), carried(params)
        self.floor = float(self.solid.points[:, 1].min())
        self.hanging, self.middle = np.zeros(len(self.solid.points)), np.zeros(3)

    def onto(self, cells: int) -> sparse.csr_array:
        """See `Filling`."""
        return _onto(cells, self._layers)

    def outwards(self, resolution: int) -> sparse.csr_array:
        """See `Filling`."""
        return _outwards(self._layers, resolution)

    def gap(self, other: Neighbour) -> float:
        """See `Filling`."""
        return gap(self._params, other)


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
