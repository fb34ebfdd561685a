"""A part of a fruit between mirror planes, which stands for the whole: an eighth of the elements with three of them.

Nodes on a plane stay on it. Self-contact sees the whole skin, put together from mirror images, so that folds close on
the planes as they do elsewhere. What is lost is the freedom to wrinkle without the symmetry: the onset's degree may
differ by what the planes allow, and a whole fruit never looks like its own mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Bools, Floats, Ints
from .mesh import FruitMesh

__all__ = ["Sector", "cut", "evened"]


#: Distance from a plane below which a node of the parametric unit sphere lies on it.
_ON = 1e-9


@dataclass(frozen=True, eq=False)
class Sector:
    """What is left of a mesh of nc columns, and how the whole is read from it.

    mesh: the part; its `sphere` is that of the whole. image: (nc,) column of the part that each column of the whole is
    an image of. sign: (nc, 3) of its coordinates. own: (nc,) which columns are in the part, as they are. share: (nc,)
    of a column's mass that the part carries. planes: flat numbers 3 node + axis of coordinates that stay 0.
    copies: parts that make up the whole.
    """

    mesh: FruitMesh
    image: Ints
    sign: Floats
    own: Bools
    share: Floats
    planes: Ints
    copies: int

    def whole(self, surface: Floats) -> Floats:
        """Return nodes of the whole surface (nc, 3) from those of the part's, in column order."""
        mirrored: Floats = surface[self.image] * self.sign
        return mirrored


def cut(mesh: FruitMesh, mirrors: str) -> Sector:
    """Return the part of `mesh` where the coordinates named in `mirrors` are not negative; all of it for "".

    Every mirror plane must be a line of nodes: an even number of elements along each edge of the cube.
    """
    columns = len(mesh.rays)
    axes = ["xyz".index(name) for name in mirrors]
    directions = np.where(np.abs(mesh.sphere.directions) < _ON, 0.0, mesh.sphere.directions)
    sign = np.ones((columns, 3))
    sign[:, axes] = np.where(directions[:, axes] < 0, -1.0, 1.0)
    own: Bools = np.all(sign > 0, axis=1)
    kept = np.flatnonzero(own)
    number = np.full(columns, -1)
    number[kept] = np.arange(len(kept))
    folded = {tuple(key): column for column, key in zip(number[kept], _rounded(directions[kept]), strict=True)}
    image = np.array([folded[tuple(key)] for key in _rounded(directions * sign)])
    on = directions[:, axes] == 0
    levels = np.arange(mesh.levels)
    inside = own[mesh.connectivity[:, 0] // mesh.levels]
    for corner in range(1, 8):
        inside &= own[mesh.connectivity[:, corner] // mesh.levels]
    connectivity = mesh.connectivity[inside]
    part = replace(
        mesh,
        positions=mesh.positions.reshape(columns, mesh.levels, 3)[kept].reshape(-1, 3),
        connectivity=number[connectivity // mesh.levels] * mesh.levels + connectivity % mesh.levels,
        is_exocarp=mesh.is_exocarp[inside],
        rays=mesh.rays[kept],
    )
    planes = [
        (3 * (np.flatnonzero(on[kept, k])[:, None] * mesh.levels + levels) + axis).ravel()
        for k, axis in enumerate(axes)
    ]
    return Sector(
        part,
        image,
        sign,
        own,
        0.5 ** on.sum(axis=1),
        np.concatenate([*planes, np.empty(0, np.int64)]).astype(np.int64),
        2 ** len(axes),
    )


def evened(heights: Floats, sector: Sector) -> Floats:
    """Return random heights (nc,) made equal on all images of a column, as rough as before: sums over root of
    copies.
    """
    found: Floats = _mean(heights, sector) * np.sqrt(sector.copies)
    return found


def mirrored(heights: Floats, sector: Sector) -> Floats:
    """Return heights (nc,) of a pattern made equal on all images of a column; the largest stays as large as it was.

    What has the sector's symmetry already is kept as it is.
    """
    mean = _mean(heights, sector)
    highest = np.abs(mean).max()
    found: Floats = mean * (np.abs(heights).max() / highest) if highest > 0 else mean
    return found


def _mean(heights: Floats, sector: Sector) -> Floats:
    """Return the mean of heights (nc,) over all images of each column."""
    if sector.copies == 1:
        return heights
    mean: Floats = (np.bincount(sector.image, weights=heights) / np.bincount(sector.image))[sector.image]
    return mean


def _rounded(directions: Floats) -> Ints:
    return np.round(directions * 1e7).astype(np.int64)
