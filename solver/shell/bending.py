"""Bending by hinges: each pair of neighbouring triangles wants its rest angle (Grinspun et al. 2003).

Energy k (theta - rest)^2 with k = D l^2 / (2 (A1 + A2)). On equilateral triangles that is exactly the plate's
D kappa^2 / 2 per area for a cylinder, whatever way it lies; the Poisson ratio in bending is -1/3 there (sum over the
three edge directions of (k_n - k_t / 3)^2), so that spheres are softer and saddles stiffer than a plate's.
Angles are positive where the surface is convex towards its normals.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints
from .topology import Topology

__all__ = ["angles", "bending", "bending_tangent", "hinge_slopes", "hinge_stiffness"]


def hinge_stiffness(g: Floats, mesh: Topology, flexural: float) -> Floats:
    """Return k (h,) from rest metrics g (f, 3); the rest length of an edge is the mean of its two triangles'."""
    found = np.empty(len(mesh.hinge_faces))
    _stiffness(g, mesh.hinge_faces, mesh.hinge_corners, flexural, found)
    return found


@njit(cache=True, error_model="numpy")
def _stiffness(g: Floats, hinge_faces: Ints, hinge_corners: Ints, flexural: float, found: Floats) -> None:
    for h in range(len(hinge_faces)):
        square, area = 0.0, 0.0
        for side in range(2):
            t, k = hinge_faces[h, side], hinge_corners[h, side]
            a, b, c = g[t, 0], g[t, 1], g[t, 2]
            square += 0.5 * (a + c - 2 * b if k == 0 else (c if k == 1 else a))
            area += 0.5 * np.sqrt(a * c - b * b)
        found[h] = flexural * square / (2 * area)


@njit(cache=True, error_model="numpy")
def angles(x: Floats, hinges: Ints) -> Floats:
    """Return the angle (h,) between the normals of each hinge's triangles [radian]."""
    found = np.empty(len(hinges))
    for t in range(len(hinges)):
        found[t] = _hinge(x, hinges, t)[0]
    return found


@njit(inline="always", error_model="numpy")
def _hinge(x: Floats, hinges: Ints, t: int) -> tuple[float, ...]:
    """Return a hinge's angle, its derivatives by the two points off its edge, and how they share out on the edge.

    The edge's second point feels -(s a + r b), its first -((1 - s) a + (1 - r) b). Numbers, not views of arrays, which
    take longer.
    """
    i, j, k, m = hinges[t, 0], hinges[t, 1], hinges[t, 2], hinges[t, 3]
    ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    ux, uy, uz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    wx, wy, wz = x[m, 0] - x[i, 0], x[m, 1] - x[i, 1], x[m, 2] - x[i, 2]
    nx, ny, nz = ey * uz - ez * uy, ez * ux - ex * uz, ex * uy - ey * ux
    ox, oy, oz = wy * ez - wz * ey, wz * ex - wx * ez, wx * ey - wy * ex
    square = ex * ex + ey * ey + ez * ez
    length = np.sqrt(square)
    first, second = nx * nx + ny * ny + nz * nz, ox * ox + oy * oy + oz * oz
    cx, cy, cz = ny * oz - nz * oy, nz * ox - nx * oz, nx * oy - ny * ox
    angle: float = np.arctan2((cx * ex + cy * ey + cz * ez) / length, nx * ox + ny * oy + nz * oz)
    # a triangle without area has no normal: its hinge exerts no force
    p = -length / first if first > 0 else 0.0
    q = -length / second if second > 0 else 0.0
    s, r = (ux * ex + uy * ey + uz * ez) / square, (wx * ex + wy * ey + wz * ez) / square
    return angle, p * nx, p * ny, p * nz, q * ox, q * oy, q * oz, s, r


@njit(cache=True, error_model="numpy")
def hinge_slopes(x: Floats, hinges: Ints, t: int, slopes: Floats) -> float:
    """Return a hinge's angle and write its derivatives by the four points to `slopes` (4, 3)."""
    angle, ax, ay, az, bx, by, bz, s, r = _hinge(x, hinges, t)
    slopes[2, 0], slopes[2, 1], slopes[2, 2] = ax, ay, az
    slopes[3, 0], slopes[3, 1], slopes[3, 2] = bx, by, bz
    for d in range(3):
        slopes[1, d] = -(s * slopes[2, d] + r * slopes[3, d])
        slopes[0, d] = -((1 - s) * slopes[2, d] + (1 - r) * slopes[3, d])
    return angle


@njit(inline="always", error_model="numpy")
def _pull(x: Floats, hinges: Ints, rest: Floats, stiffness: Floats, t: int) -> tuple[float, ...]:
    """Return a hinge's energy, and its derivatives by the hinge's four points, three numbers each."""
    angle, ax, ay, az, bx, by, bz, s, r = _hinge(x, hinges, t)
    gap = angle - rest[t]
    force = 2 * stiffness[t] * gap
    u, v = 1 - s, 1 - r
    return (
        stiffness[t] * gap * gap,
        force * -(u * ax + v * bx), force * -(u * ay + v * by), force * -(u * az + v * bz),
        force * -(s * ax + r * bx), force * -(s * ay + r * by), force * -(s * az + r * bz),
        force * ax, force * ay, force * az,
        force * bx, force * by, force * bz,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def bending(x: Floats, hinges: Ints, rest: Floats, stiffness: Floats, gradient: Floats) -> float:
    """Return the bending energy and add its gradient to `gradient` (n, 3); rest and stiffness (h,)."""
    energy = 0.0
    for t in range(len(hinges)):
        own, ix, iy, iz, jx, jy, jz, kx, ky, kz, mx, my, mz = _pull(x, hinges, rest, stiffness, t)
        energy += own
        i, j, k, m = hinges[t, 0], hinges[t, 1], hinges[t, 2], hinges[t, 3]
        gradient[i, 0] += ix
        gradient[i, 1] += iy
        gradient[i, 2] += iz
        gradient[j, 0] += jx
        gradient[j, 1] += jy
        gradient[j, 2] += jz
        gradient[k, 0] += kx
        gradient[k, 1] += ky
        gradient[k, 2] += kz
        gradient[m, 0] += mx
        gradient[m, 1] += my
        gradient[m, 2] += mz
    return energy


@njit(cache=True, error_model="numpy")
def bending_tangent(x: Floats, hinges: Ints, stiffness: Floats, places: Ints, blocks: Floats) -> None:
    """Add the Gauss-Newton tangent 2 k grad(theta) grad(theta)^T to `blocks` (nnz, 3, 3); places (h, 16)."""
    slopes = np.empty((4, 3))
    for t in range(len(hinges)):
        hinge_slopes(x, hinges, t, slopes)
        for u in range(4):
            for v in range(4):
                at = places[t, 4 * u + v]
                for d in range(3):
                    for h in range(3):
                        blocks[at, d, h] += 2 * stiffness[t] * slopes[u, d] * slopes[v, h]
