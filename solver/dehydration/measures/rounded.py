"""Nodal fields of the outer surface read without overshoot: B-splines whose control points lie on the finite elements.

A spline through the nodes swings beyond them at every sharp crease, by up to 0.04 r1 on coarse meshes, and so through
the wall that touches there. A B-spline never leaves the hull of its control points (Schoenberg's variation diminishing
approximation, 1967): walls whose elements do not cross stay apart, and it is as smooth. It rounds creases instead.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import NdBSpline, make_interp_spline

from ...arrays import Floats, Ints
from ..fresh.mesh import CubedSphere, Sampler

__all__ = ["Rounded"]


class Rounded:
    """Reads a nodal field at a sampler's lattice by B-splines with so many control points to an element's edge.

    With one, it stays off a crease by a sixth of an element times the change of slope; with two by a twelfth, and the
    facets of the elements begin to show. Both faces at an edge of the cube share its control points: no step there.
    """

    def __init__(self, sphere: CubedSphere, sampler: Sampler, per_element: int) -> None:
        self._faces = sphere.faces
        count = per_element * sphere.n
        places = np.linspace(-np.pi / 4, np.pi / 4, count + 1)
        self._knots: Floats = make_interp_spline(places, places, k=3).t
        # a spline with these is the field itself where that is linear (Greville's abscissae), in elements
        at = np.array([self._knots[i + 1 : i + 4].mean() for i in range(count + 1)])
        at = (at + np.pi / 4) * (2 * sphere.n / np.pi)
        self._first: Ints = np.clip(at.astype(np.int64), 0, sphere.n - 1)
        self._part: Floats = at - self._first
        self._here = [np.flatnonzero(sampler.face == face) for face in range(6)]
        self._at = np.stack([sampler.alpha, sampler.beta], axis=1)

    def __call__(self, nodal: Floats) -> Floats:
        """Return the field (nd, c) at the lattice's points, (points, c)."""
        out = np.empty((len(self._at), nodal.shape[1]))
        for face, here in zip(self._faces, self._here, strict=True):
            control = self._between(self._between(nodal[face]).swapaxes(0, 1)).swapaxes(0, 1)
            out[here] = NdBSpline((self._knots, self._knots), np.ascontiguousarray(control), 3)(self._at[here])
        return out

    def _between(self, grid: Floats) -> Floats:
        """Return the values (n + 1, ...) of one axis, linear in between, where control points lie."""
        part = self._part[:, None, None]
        found: Floats = grid[self._first] * (1 - part) + grid[self._first + 1] * part
        return found
