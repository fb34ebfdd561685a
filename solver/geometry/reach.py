"""How far a triangle mesh around the origin reaches along each direction of the lattice: what stands there last.

A triangle is looked at along the directions within the cone around it; where a ray meets it is solved for directly
(Moeller & Trumbore 1997, doi 10.1080/10867651.1997.10487468), so triangles may be as large as they like.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..arrays import Array, Floats, Ints
from ..lattice import azimuths, colatitudes

__all__ = ["reach"]

#: Share of a triangle by which a ray may miss it: along a common edge one of two is met.
_SLACK = 1e-9


def reach(points: Array, triangles: Array, n: int) -> Floats:
    """Return the distance (n, 2n) of the farthest point of a mesh (v, 3), (f, 3) along the lattice's directions.

    In the unit of the points; 0 where no triangle is met.
    """
    found = np.zeros((n, 2 * n))
    theta, phi = colatitudes(n), azimuths(n)
    corners = np.ascontiguousarray(points, dtype=np.float64)
    faces = np.ascontiguousarray(triangles, dtype=np.int64)
    _reach(corners, faces, np.sin(theta), np.cos(theta), np.cos(phi), np.sin(phi), found)
    return found


@njit(cache=True, error_model="numpy")
def _reach(
    points: Floats,
    faces: Ints,
    sine: Floats,
    cosine: Floats,
    across: Floats,
    along: Floats,
    found: Floats,
) -> None:
    n = len(sine)
    step = math.pi / n
    for f in range(len(faces)):
        a, b, c = points[faces[f, 0]], points[faces[f, 1]], points[faces[f, 2]]
        first, last, middle, half = _cone(a, b, c, n)
        for i in range(first, last + 1):
            low, count = 0, 2 * n
            if half < math.pi:
                low = math.floor((middle - half) / step)
                count = min(2 * n, math.ceil(2 * half / step) + 2)
            for k in range(count):
                j = (low + k) % (2 * n)
                t = _meet(a, b, c, sine[i] * across[j], cosine[i], sine[i] * along[j])
                if t > found[i, j]:
                    found[i, j] = t


@njit(cache=True, error_model="numpy")
def _cone(a: Floats, b: Floats, c: Floats, n: int) -> tuple[int, int, float, float]:
    """Return the rows, and the azimuth with half a width, of a cone that holds a triangle; all where it is wide."""
    la, lb, lc = _length(a), _length(b), _length(c)
    if la * lb * lc == 0.0:
        return 0, n - 1, 0.0, math.pi
    d = a / la + b / lb + c / lc
    ld = _length(d)
    if ld < 1e-6:
        return 0, n - 1, 0.0, math.pi
    least = min(_dot(a, d) / la, _dot(b, d) / lb, _dot(c, d) / lc) / ld
    if least < 0.1:
        return 0, n - 1, 0.0, math.pi
    rho = math.acos(min(least, 1.0)) + 1e-9
    theta = math.acos(max(-1.0, min(1.0, d[1] / ld)))
    first = max(0, math.ceil((theta - rho) * n / math.pi - 0.5))
    last = min(n - 1, math.floor((theta + rho) * n / math.pi - 0.5))
    if theta - rho <= 0 or theta + rho >= math.pi:
        return first, last, 0.0, math.pi
    return first, last, math.atan2(d[2], d[0]), math.asin(min(1.0, math.sin(rho) / math.sin(theta)))


@njit(cache=True, error_model="numpy")
def _meet(a: Floats, b: Floats, c: Floats, x: float, y: float, z: float) -> float:
    """Return how far along (x, y, z) the triangle is met, 0 if it is not."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    px, py, pz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    det = ux * px + uy * py + uz * pz
    if det == 0.0:
        return 0.0
    u = -(a[0] * px + a[1] * py + a[2] * pz) / det
    if u < -_SLACK or u > 1 + _SLACK:
        return 0.0
    qx, qy, qz = uy * a[2] - uz * a[1], uz * a[0] - ux * a[2], ux * a[1] - uy * a[0]
    v = (x * qx + y * qy + z * qz) / det
    if v < -_SLACK or u + v > 1 + _SLACK:
        return 0.0
    t = (vx * qx + vy * qy + vz * qz) / det
    found: float = max(t, 0.0)
    return found


@njit(cache=True, error_model="numpy")
def _dot(a: Floats, b: Floats) -> float:
    found: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return found


@njit(cache=True, error_model="numpy")
def _length(a: Floats) -> float:
    return math.sqrt(_dot(a, a))
