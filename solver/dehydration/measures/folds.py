"""Folds read without crossing: where splines through the nodes cross, B-splines that stay between them take over."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array, csr_array

from ...arrays import Floats, Ints
from ...geometry.crossings import Crossings
from ...lattice import closed_lattice
from ..fresh.mesh import CubedSphere, Sampler
from .facets import corners
from .rounded import Rounded

__all__ = ["Folds"]

#: Rounds of rounding more places, or more strongly: where a lattice is too coarse for a fold no more of it helps.
_ROUNDS = 4


class Folds:
    """Rounds creases on the lattice of one resolution, around the places that cross and nowhere else.

    A node's level is how strongly: 0 not at all, 2 as a B-spline whose control points are the nodes (`Rounded`), 1 half
    as much: the mean of that and one with four times as many, which alone would show the elements' facets. The share
    of each fades from node to node and is a B-spline itself, so that no seam is seen.
    """

    def __init__(
        self, sphere: CubedSphere, sampler: Sampler, fresh: Floats, look: Callable[[Floats], Crossings], image: Ints
    ) -> None:
        """fresh: (n, 2n, 3). look: how it is told where a surface on that lattice crosses. image: (nd,) what node each
        is a mirror image of: all images are rounded alike, though a lattice's triangles are no images of each other.
        """
        self._fresh, self._look, self._image = fresh, look, image
        self._fine, self._strong = Rounded(sphere, sampler, 2), Rounded(sphere, sampler, 1)
        self._around, self._corners = _around(sphere), corners(sphere, sampler)
        # from one point of the lattice to the next there may be several elements
        self._rings = 1 + 2 * sphere.n // len(fresh)

    def apart(self, spline: Floats, shift: Floats, found: Crossings, level: Ints) -> tuple[Floats, Crossings, Ints]:
        """Return the surface (n, 2n, 3) out of contact, or nearly so, where it still crosses, and the levels (nd,).

        spline: (n, 2n, 3). shift: (nd, 3) of the nodes. found: where the spline crosses. level: where to begin.
        """
        shape = spline.shape
        strong = self._fresh + self._strong(shift).reshape(shape)
        light = (strong + self._fresh + self._fine(shift).reshape(shape)) / 2
        position = spline
        for _ in range(_ROUNDS):
            if position is not spline or not level.any():
                level = self._raised(level, found)
            some, more = self._strong(self._fading(level)).T.reshape(2, *shape[:2], 1)
            position = spline + some * (light - spline) + more * (strong - light)
            found = self._look(position)
            if not found.count:
                break
        return position, found, level

    def _fading(self, level: Ints) -> Floats:
        """Return the shares (nd, 2) of rounding at all and of rounding strongly, which fade over the nodes around."""
        count = self._around.sum(axis=1)
        shares = (level >= np.array([[1], [2]])).astype(float)
        return np.stack([np.maximum(share, self._around @ share / count) for share in shares], axis=1)

    def _raised(self, level: Ints, found: Crossings) -> Ints:
        """Return the levels with those of nodes that cross, and as far around as splines reach, one higher."""
        points = np.unique(closed_lattice(len(self._fresh))[found.pairs])
        # of triangles at a pole the other corners tell
        points = points[points < len(self._corners)]
        near = np.zeros(len(level))
        near[self._corners[points]] = 1
        for _ in range(self._rings):
            near = np.sign(self._around @ near)
        # where no more can be done, it is done farther around
        near = np.sign(near + self._around @ (near * (level == 2)))
        reached = np.bincount(self._image, near)[self._image] > 0
        raised: Ints = np.minimum(level + reached, 2)
        return raised


def _around(sphere: CubedSphere) -> csr_array:
    """Return (nd, nd), 1 for nodes of a common quad, and for a node and itself."""
    size = len(sphere.directions)
    rows, columns = np.repeat(sphere.quads, 4, axis=1).ravel(), np.tile(sphere.quads, 4).ravel()
    near = coo_array((np.ones(len(rows)), (rows, columns)), (size, size)).tocsr()
    near.data[:] = 1
    return near
