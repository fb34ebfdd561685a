"""Which nodes of a regular lattice lie inside of a closed triangle mesh: crossings along lines, counted by sense.

A line along x that enters the mesh n times more often than it has left it is inside where n > 0, so that parts which
overlap are one body, and triangles may be wound outwards or, all of them, inwards. Edges decide by their two ends in a
fixed order: a line between two triangles meets one of them, never both and never none. Only a line through a vertex
would be undecided, so lines pass their nodes by a millionth of a step.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints, Ints32

__all__ = ["inside"]

#: How far lines pass their nodes by, over the step.
_PAST = np.array([0.0, 1.237e-6, 0.771e-6])


def inside(origin: Floats, step: float, shape: tuple[int, int, int], points: Floats, faces: Ints) -> Bools:
    """Return whether nodes origin + step (i, j, k) of a lattice (shape) lie in a closed mesh (v, 3), (f, 3)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    outwards = np.sum(a * np.cross(b, c)) > 0
    change = np.zeros((shape[0] + 1, *shape[1:]), np.int32)
    _cross(np.asarray(origin, float) + step * _PAST, step, points, faces, 1 if outwards else -1, change)
    return np.asarray(np.cumsum(change[:-1], axis=0) > 0)


@njit(cache=True, error_model="numpy")
def _side(points: Floats, i: int, j: int, y: float, z: float) -> int:
    """Return on which side of the edge i-j, seen along x, a line lies: 1 or -1, of j-i the opposite."""
    turn = 1
    if i > j:
        i, j, turn = j, i, -1
    doubled = (points[j, 1] - points[i, 1]) * (z - points[i, 2]) - (points[j, 2] - points[i, 2]) * (y - points[i, 1])
    return turn if doubled >= 0 else -turn


@njit(cache=True, error_model="numpy")
def _cross(origin: Floats, step: float, points: Floats, faces: Ints, sense: int, change: Ints32) -> None:
    """Add to change (i, j, k) what crossings between nodes i - 1 and i of a line do to how often it is inside."""
    nx, ny, nz = change.shape[0] - 1, change.shape[1], change.shape[2]
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        low_y = min(points[a, 1], points[b, 1], points[c, 1])
        high_y = max(points[a, 1], points[b, 1], points[c, 1])
        low_z = min(points[a, 2], points[b, 2], points[c, 2])
        high_z = max(points[a, 2], points[b, 2], points[c, 2])
        y1, z1 = points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        y2, z2 = points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        doubled = y1 * z2 - z1 * y2
        for j in range(max(0, int(np.ceil((low_y - origin[1]) / step))), ny):
            y = origin[1] + step * j
            if y > high_y:
                break
            for k in range(max(0, int(np.ceil((low_z - origin[2]) / step))), nz):
                z = origin[2] + step * k
                if z > high_z:
                    break
                turn = _side(points, a, b, y, z)
                if _side(points, b, c, y, z) != turn or _side(points, c, a, y, z) != turn or doubled == 0:
                    continue
                u = ((y - points[a, 1]) * z2 - (z - points[a, 2]) * y2) / doubled
                v = (y1 * (z - points[a, 2]) - z1 * (y - points[a, 1])) / doubled
                x = points[a, 0] + u * (points[b, 0] - points[a, 0]) + v * (points[c, 0] - points[a, 0])
                i = min(max(int(np.ceil((x - origin[0]) / step)), 0), nx)
                # a normal against x is where the line enters
                change[i, j, k] -= sense * turn
