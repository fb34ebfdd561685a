"""Flesh in a mesh of the user's own, or behind an open one: stuffed tetrahedra that carry its surface.

The mesh need not be fit for anything but to say what is inside: each of its vertices goes with the nearest place on the
skin of the tetrahedra, and keeps its distance from there, so that detail finer than the flesh stays as it was drawn.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from ...arrays import Bools, Floats, Ints
from ...contract import InvalidGeometry
from ...geometry.nearest import Nearest, nearest
from ...geometry.stuffing import Stuffed, boundary, pieces, stuffed, touched
from ..params import DecayParams
from ..surfaces.imported import extent_of, rays_from
from ..surfaces.places import Neighbour
from ..surfaces.surface import Surface, extent
from .rind import place, rind
from .solid import Solid, volumes

__all__ = ["Embedded"]

#: Tetrahedra of a cube of the lattice, and of a round fruit in k shells over k^3: a mesh gets about as many.
_PER_CUBE, _PER_SHELLS = 12.0, 20.0
#: No vertex may lie farther from the flesh than this share of the lattice's edge: there it would be missing. Where no
#: lattice comes so near, at sharp tips, it is a share of the edge that the quality asked for, or else the second one.
_FAR, _TIP = 0.75, 1.5
#: The same where the borders of a rind are ridges, which the lattice cuts off.
_RIDGE = 1.25
#: Refinements of a lattice that is too coarse for a thin part, and the most tetrahedra that one may have.
_TRIES, _MOST = 5, 150_000
_FINER = 1.5
#: Tetrahedra of a refined lattice that a mesh touches, over the most it may keep: a leaf keeps half of them, and few
#: only where it lies between two layers of nodes. What touches more is not laid at all: a lattice of 1.1 million for a
#: leaf took 24 s to lay, and was refused.
_TOUCHED = 6


class Embedded:
    """Flesh in a mesh of the user's own, of about as many tetrahedra as a round fruit of so many layers.

    Raises:
        InvalidGeometry: the mesh is too thin somewhere to hold flesh, or open and not fit for a rind.

    """

    def __init__(self, params: DecayParams, surface: Surface, layers: int) -> None:
        closed = extent_of(surface)
        points, faces = surface.points, surface.faces
        if closed is None:
            points, faces = rind(points, faces, params.flesh.rind)
        elif closed.volume <= 0:
            raise InvalidGeometry("the mesh is flat: nothing is inside of it.", advice="Take body=none.")
        # what an open mesh weighs is what the fruit of the parameters does, as in its fields
        self._surface, self.extent = surface, closed or extent(params)
        filled, least = _filled(points, faces, layers, _FAR if closed else _RIDGE)
        skin_faces = boundary(filled.tets)
        skin, outside = np.unique(skin_faces, return_inverse=True)
        below = nearest(filled.points, surface.points, surface.faces)
        depth = below.distance.copy()
        if closed is not None:
            depth[skin] = 0.0
        self.solid = Solid(
            filled.points,
            filled.tets,
            volumes(filled.points, filled.tets),
            np.zeros(len(filled.tets), np.bool_),
            rays_from(filled.points),
            depth,
            skin,
            outside.reshape(-1, 3),
        )
        self.inwards = _matrix(below, surface.faces, len(surface.points))
        held = nearest(surface.points, filled.points[skin], self.solid.faces)
        shown = ~_buried(filled, surface.points, held.distance, least)
        self._onto = _matrix(held, self.solid.faces, len(skin))
        self.core = depth >= np.median(depth)
        # wherever it was drawn, it shrinks in its place
        self.middle = np.average(filled.points[filled.tets].mean(axis=1), weights=self.solid.volume, axis=0)
        self.carried = False
        self.floor = float(points[:, 1].min())
        self.hanging = np.zeros(len(filled.points))
        # each point of the skin stands for the vertices that go with it, down to the lowest
        most = self.solid.faces[held.face, np.argmax(held.shares, axis=1)][shown]
        np.minimum.at(self.hanging, skin[most], surface.points[shown, 1] - filled.points[skin[most], 1])

    def onto(self, cells: int) -> sparse.csr_array:
        """See `Filling`: the mesh has no cells, and its vertices are meant."""
        return self._onto

    def outwards(self, resolution: int) -> sparse.csr_array:
        """See `Filling`.

        Raises:
            InvalidGeometry: always: a mesh has no lattice.

        """
        raise InvalidGeometry("a mesh has no lattice of colatitudes.", advice="Ask for mesh_position.")

    def gap(self, other: Neighbour) -> float:
        """See `Filling`."""
        far = np.linalg.norm(self._surface.points - np.array(other.position), axis=1)
        return float(far.min()) - other.radius


def _filled(points: Floats, faces: Ints, layers: int, far: float) -> tuple[Stuffed, float]:
    """Return flesh in a closed surface (v, 3), (f, 3) that hangs together, so many edges from vertices at most.

    And how far a vertex may be from it.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    volume = abs(float(np.sum(a * np.cross(b, c)))) / 6
    edge = asked = float((_PER_CUBE * volume / (_PER_SHELLS * layers**3)) ** (1 / 3))
    why, tipped = "it is too thin for its size", dict[float, tuple[Stuffed, float]]()
    for _ in range(_TRIES):
        crowd = touched(points, faces, edge)
        if crowd == np.inf or (edge < asked and crowd > _TOUCHED * _MOST):
            break
        found = stuffed(points, faces, edge)
        # a leaf holds nothing of a coarse lattice, and more of a finer one than a body can settle with
        if len(found.tets) > _MOST and edge < asked:
            break
        why = _lacking(found)
        if not why:
            away = _away(found, points, far * edge)
            worst = int(np.argmax(away))
            if away[worst] <= far * edge:
                return found, far * edge
            why = f"it is too thin at {place(points[worst])}"
            # a tip is too sharp for every lattice: what is hardly longer than an edge of the one asked for goes along
            for most in (far, _TIP):
                if away[worst] <= most * asked:
                    tipped.setdefault(most, (found, far * edge))
        edge /= _FINER
        if len(found.tets) * _FINER**3 > _MOST:
            break
    if tipped:
        return tipped[min(tipped)]
    raise InvalidGeometry(
        f"the mesh cannot be filled with flesh: {why}.",
        advice="Thicken it there, close what is open, give one side of a leaf alone (an open mesh gets a rind), "
        "or take body=none.",
    )


def _lacking(found: Stuffed) -> str:
    """Return what is wrong with flesh, and where; nothing if it is whole."""
    if not len(found.tets):
        return "it is thinner than the lattice everywhere"
    count, of = pieces(found.tets, len(found.points))
    if count > 1:
        least = int(np.argmin(np.bincount(of)))
        return f"a part about {place(found.points[of == least].mean(axis=0))} does not hang together with the rest"
    return ""


def _away(found: Stuffed, points: Floats, far: float) -> Floats:
    """Return how far points (v, 3) are from the skin of flesh (v), 0 for those that are deeper in it than `far`."""
    skin, faces = np.unique(boundary(found.tets), return_inverse=True)
    away = nearest(points, found.points[skin], faces.reshape(-1, 3)).distance
    return np.where(_buried(found, points, away, far), 0.0, away)


def _buried(found: Stuffed, points: Floats, away: Floats, far: float) -> Bools:
    """Return which points (v, 3), so far from the skin of flesh (v), lie deeper in it than `far`: where parts overlap.

    Whoever is nearer to the middle of a tetrahedron than to the skin is inside: from outside the way goes through it.
    """
    deep = away > far
    middles = KDTree(found.points[found.tets].mean(axis=1))
    deep[deep] = middles.query(points[deep])[0] < away[deep]
    return np.asarray(deep)


def _matrix(found: Nearest, faces: Ints, count: int) -> sparse.csr_array:
    """Return the matrix that takes a field (count) of a mesh's vertices to the bound points."""
    index = (np.repeat(np.arange(len(found.face)), 3), faces[found.face].ravel())
    return sparse.csr_array((found.shares.ravel(), index), shape=(len(found.face), count))
