"""How deep points are in a closed triangle mesh, and the shortest way out of it.

Whether the nearest point is seen from inside is told by the pseudonormal of what it lies on: a triangle's normal, the
sum of the two beside an edge, at a vertex the sum weighted by angles, which alone is right for all points (Baerentzen
and Aanaes 2005, doi 10.1109/TVCG.2005.49).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints
from .nearest import tree_of

__all__ = ["Signed"]

#: Share of a corner below which the nearest point does not belong to it.
_NONE = 1e-9
#: A depth below this, over the mesh's size, has no way out but the surface's normal.
_SHALLOW = 1e-12


class Signed:
    """A closed mesh (v, 3), (f, 3), wound counter-clockwise from outside, as something to be deep in."""

    def __init__(self, points: Floats, faces: Ints) -> None:
        self.points, self.faces = points, faces
        self._tree = tree_of(points, faces)
        corners = points[faces]
        # side k leads from corner k to the next
        sides = np.roll(corners, -1, axis=1) - corners
        normals = np.cross(sides[:, 0], sides[:, 1])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        self._normals = normals
        unit = sides / np.maximum(np.linalg.norm(sides, axis=2), 1e-300)[..., None]
        angles = np.arccos(np.clip(-(unit * np.roll(unit, 1, axis=1)).sum(axis=2), -1, 1))
        self._at_vertices = np.zeros_like(points)
        np.add.at(self._at_vertices, faces, angles[..., None] * normals[:, None])
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)[1].reshape(-1)
        both = np.zeros((edge.max() + 1, 3))
        np.add.at(both, edge, np.repeat(normals, 3, axis=0))
        self._at_sides = both[edge].reshape(-1, 3, 3)
        #: Corners (3,) of the box about it.
        self.low, self.high = points.min(axis=0), points.max(axis=0)
        self.size = float((self.high - self.low).max())

    def depth(self, x: Floats) -> tuple[Floats, Floats]:
        """Return how deep points (n, 3) are, below 0 outside (n,), and the way (n, 3) on which they come out."""
        found = self._tree.nearest(x)
        off = x - np.einsum("ij,ijk->ik", found.shares, self.points[self.faces[found.face]])
        on = found.shares > _NONE
        # what the nearest point lies on: the triangle, the side that does not touch the corner left out, or a corner
        normal = self._normals[found.face].copy()
        two, one = on.sum(axis=1) == 2, on.sum(axis=1) == 1
        normal[two] = self._at_sides[found.face[two], (np.argmin(on[two], axis=1) + 1) % 3]
        normal[one] = self._at_vertices[self.faces[found.face[one], np.argmax(on[one], axis=1)]]
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        side = np.sign((off * normal).sum(axis=1))
        near = found.distance > _SHALLOW * self.size
        way = np.where(near[:, None], side[:, None] * off / np.maximum(found.distance, 1e-300)[:, None], normal)
        return -side * found.distance, way

    def thick(self) -> float:
        """Return half of how thick it is, from its triangles' middles inwards: all area but the thinnest 1 %."""
        corners = self.points[self.faces]
        middles = corners.mean(axis=1)
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        # the ball that touches the middle from inside and is as large as it can be: halved until it fits
        deep = np.full(len(middles), self.size / 2)
        for _ in range(_HALVINGS):
            within = self.depth(middles - deep[:, None] * self._normals)[0] >= (1 - _FITS) * deep
            if within.all():
                break
            deep = np.where(within, deep, deep / _SQRT2)
        order = np.argsort(deep)
        share = np.cumsum(areas[order]) / areas.sum()
        return float(deep[order][np.searchsorted(share, _THINNEST)])


#: Balls shrink by so much, so often; they fit where their middle is so nearly as deep as their radius.
_SQRT2, _HALVINGS, _FITS = 2**0.5, 24, 0.05
_THINNEST = 0.01
