"""Whether a surface around the origin is seen whole from there: then it crosses itself nowhere.

In plain numpy, so that whoever asks for smooth shapes alone loads no compiler. `solver.geometry.inward` looks at the
others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["STEEP", "faces_outward"]

#: Cosine between a triangle's normal and the direction to it below which it counts as facing inwards.
STEEP = 0.03
#: Points that are looked at together: what they take stays in the processor's nearest memory.
_AT_ONCE = 8192

Field = NDArray[np.floating]


def faces_outward(points: Field, poles: Field) -> bool:
    """Return whether all triangles of `closed_lattice` face the outside, for points (n, 2n, 3) and poles (2, 3).

    An edge f to the east and an edge d to the south of a point p, or from the north to the one after it, span a
    triangle of the volume (p x f) . d / 6. What is near to facing inwards may count as such: a normal is taken for as
    long as the product of its edges.
    """
    rows, columns = points.shape[:2]
    # by component, closed in azimuth, a row of each pole around
    x = np.empty((3, rows + 2, columns + 1), points.dtype)
    for k in range(3):
        x[k, 1:-1, :-1] = points[..., k]
        x[k, 0], x[k, -1] = poles[0, k], poles[1, k]
    x[:, :, -1] = x[:, :, 0]
    band = max(1, _AT_ONCE // columns)
    return all(_band(x[:, first : first + band + 2]) for first in range(0, rows, band))


def _band(x: Field) -> bool:
    """Return whether the triangles between the rows of x (3, rows, columns), at those within, face the outside."""
    p = x[:, 1:-1, :-1]
    east = x[:, 1:-1, 1:] - p
    south = x[:, 1:] - x[:, :-1]
    span = np.empty_like(east)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(p[j], east[k], out=span[i])
        span[i] -= p[k] * east[j]
    least = _square(p) * _square(east)
    least *= STEEP**2
    length = _square(south)
    # the one with the edge from the point to the south, then the one with that to the next point from the north
    for edges, lengths in ((south[:, 1:, :-1], length[1:, :-1]), (south[:, :-1, 1:], length[:-1, 1:])):
        volume = span[0] * edges[0]
        volume += span[1] * edges[1]
        volume += span[2] * edges[2]
        if not volume.min() > 0:
            return False
        volume *= volume
        volume -= least * lengths
        if not volume.min() > 0:
            return False
    return True


def _square(x: Field) -> Field:
    found: Field = x[0] * x[0]
    found += x[1] * x[1]
    found += x[2] * x[2]
    return found
