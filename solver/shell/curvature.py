"""Rest curvature as a tensor of each triangle, and as angles of hinges: exact ways there and back.

A triangle whose corners lie on a surface with second form b meets the tangent plane of the surface at the middle of an
edge under the angle (b(m, m) - b(e, e) / 4) / (2 height), m from that middle to the opposite corner. In the basis of
the triangle's own edges that is (b12, b11 - b12, b22 - b12) / (2 height) for the edges opposite to corners 0, 1, 2:
three angles for three numbers. A hinge's rest angle is the sum of both sides.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from .membrane import areas, squares
from .topology import Topology

__all__ = ["added_angles", "from_angles"]


def _heights(g: Floats) -> Floats:
    """Return heights (f, 3) over the edges opposite to corners 0, 1, 2."""
    return 2 * areas(g)[:, None] / np.sqrt(squares(g))


def _to_angles(b: Floats, g: Floats) -> Floats:
    """Return the angles (f, 3) of triangles with second forms b (f, 3: b11, b12, b22) and rest metrics g (f, 3)."""
    b11, b12, b22 = b.T
    return np.stack([b12, b11 - b12, b22 - b12], -1) / (2 * _heights(g))


def added_angles(b: Floats, g: Floats, mesh: Topology) -> Floats:
    """Return the angles (h,) of hinges between triangles with second forms b (f, 3)."""
    sides = _to_angles(b, g)
    found: Floats = sides[mesh.hinge_faces, mesh.hinge_corners].sum(axis=1)
    return found


def from_angles(rest: Floats, g: Floats, mesh: Topology) -> Floats:
    """Return second forms (f, 3) that have the hinges' angles `rest` (h,), shared by heights between both sides.

    Beyond a border a triangle takes the curvature of its other edges.
    """
    heights = _heights(g)
    sides = np.full(heights.shape, np.nan)
    both = heights[mesh.hinge_faces, mesh.hinge_corners]
    sides[mesh.hinge_faces, mesh.hinge_corners] = rest[:, None] * both / both.sum(axis=1, keepdims=True)
    known = ~np.isnan(sides)
    bent = np.where(known, sides, 0.0) / heights
    mean = bent.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    sides = np.where(known, sides, mean[:, None] * heights)
    first, second, third = (2 * heights * sides).T
    return np.stack([second + first, first, third + first], -1)
