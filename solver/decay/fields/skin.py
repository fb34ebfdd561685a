"""The skin that everything grows on: what wounds and cuts have broken of it, where places are, and what evaporates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import KDTree

from ...arrays import Floats, Ints
from ...fruit import directions
from ..environment import evaporated, opened, reference_radius
from ..params import DecayParams
from ..surfaces.cut import bare
from ..surfaces.imported import extent_of
from ..surfaces.seeds import seeds
from ..surfaces.surface import Surface, extent, geodesic, lay, triangulated
from .drawn import opened_skin, seen
from .waiting import Seed

__all__ = ["Skin", "laid"]


def laid(params: DecayParams, cells: int) -> Surface:
    """Return what everything grows on: the imported mesh, or the fruit's own surface of so many cells.

    Raises:
        InvalidGeometry: the mesh has points that no triangle of positive area touches.

    """
    if params.mesh is None:
        return lay(params, cells)
    return triangulated(np.array(params.mesh.points, float), np.array(params.mesh.faces, np.int64))


class Skin:
    """The surface of a fruit or mesh (v vertices), seen from its middle.

    bare (v): where cuts left flesh without a skin. rays (v, 3): directions of the vertices. painted (v): where wounds
    are painted, None where they are not. extent: area and volume. radius: that of a ball [mm].
    """

    def __init__(self, params: DecayParams, cells: int, surface: Surface) -> None:
        self._params, self.surface = params, surface
        self.bare = bare(params.cuts, surface.points)
        self.rays = geodesic(cells)[0] if params.mesh is None else seen(params, surface.points)
        self._tree = KDTree(self.rays)
        self.painted = opened_skin(params, self.rays)
        closed = extent_of(surface) if params.mesh is not None else None
        self.extent = closed or extent(params)
        self.radius = 1e3 * reference_radius(params, self.extent)
        self._wounds = self._opened()

    def wounds(self) -> Iterator[Seed]:
        """Yield where rot enters; what is painted comes last and has no place."""
        for wound in seeds(self._params):
            ray = directions(*np.radians([wound.colatitude, wound.azimuth]))
            if wound.vertex is not None:
                ray = self.rays[wound.vertex]
            centre = self.place(ray) if wound.vertex is None else self.surface.points[wound.vertex]
            yield Seed(True, ray, centre, wound.radius)
        if self.painted is not None:
            yield Seed(True, None, None, 0.0)

    def _opened(self) -> Floats:
        """Return where wounds and cuts have broken the skin on day 0, 0 to 1 (v)."""
        found = self.bare.astype(float)
        for seed in self.wounds():
            if seed.place is None:
                assert self.painted is not None
                found = np.maximum(found, self.painted)
            else:
                far = ((self.surface.points - seed.place) ** 2).sum(axis=1)
                found = np.maximum(found, np.clip(1 - far / seed.radius**2, 0, None) ** 2)
        return found

    def nearest(self, ray: Floats) -> int:
        """Return the vertex that lies nearest to a unit direction."""
        return int(self._tree.query(ray)[1])

    def near(self, ray: Floats, radius: float) -> Ints:
        """Return the vertices within a distance on the unit sphere of a direction, the nearest one among them."""
        return np.array(sorted({*self._tree.query_ball_point(ray, radius), self.nearest(ray)}))

    def place(self, ray: Floats) -> Floats:
        """Return the point (3) of the skin in a unit direction; of an imported mesh the vertex nearest to it."""
        if self._params.mesh is not None:
            return np.asarray(self.surface.points[self.nearest(ray)])
        x, y, z = ray
        return self._params.surface(np.arccos(np.clip(y, -1, 1)), np.arctan2(z, x))

    def broken(self, rotten: Floats) -> Floats:
        """Return where the skin is rotten (v) or wounded, 0 to 1 (v)."""
        return np.maximum(rotten, self._wounds)

    def conductance(self, broken: Floats) -> float:
        """Return the mean conductance of the whole skin, broken where it is (v) [g/(m2 s MPa)]."""
        more = opened(self._params) - self._params.transpiration
        return self._params.transpiration + more * self.surface.mean(broken)

    def evaporated(self, broken: Floats, start: float, end: float, factor: float) -> float:
        """Return what evaporates between two days over the fresh weight, broken where it is (v), times a factor."""
        return self.conductance(broken) * evaporated(self._params, self.extent, start, end) * factor
