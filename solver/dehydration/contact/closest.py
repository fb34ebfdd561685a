"""The closest point of a bilinear quad to a node."""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact.data import OPTIONS, Single, Singles

__all__ = ["closest"]


@njit(**OPTIONS)
def closest(
    x: Singles, step: Singles, row: int, a: int, b: int, c: int, d: int, u: Single, v: Single, exact: Single
) -> tuple[Single, Single, Single, Single, Single, Single, Single, Single, Single]:
    """Closest point of a bilinear quad to a node, from a first guess u, v (the last result, if there is one).

    Positions are x - step, both (nn, >= 3) float32; row of the node, a, b, c, d of the corners. A projected Newton
    method in the square [-1, 1]^2 down to a squared slope `exact` (length squared); it needs no step at all while
    nothing moves. Returns u, v, the foot minus the node (3), its squared length and the quad's normal at the foot, not
    normalised (3).
    """
    zero, one, quarter = np.float32(0), np.float32(1), np.float32(0.25)
    px, py, pz = x[row, 0] - step[row, 0], x[row, 1] - step[row, 1], x[row, 2] - step[row, 2]
    # foot - node = m + u s + v t + u v w; corners relative to the node keep float32's digits
    ax, ay, az = x[a, 0] - step[a, 0] - px, x[a, 1] - step[a, 1] - py, x[a, 2] - step[a, 2] - pz
    bx, by, bz = x[b, 0] - step[b, 0] - px, x[b, 1] - step[b, 1] - py, x[b, 2] - step[b, 2] - pz
    cx, cy, cz = x[c, 0] - step[c, 0] - px, x[c, 1] - step[c, 1] - py, x[c, 2] - step[c, 2] - pz
    dx, dy, dz = x[d, 0] - step[d, 0] - px, x[d, 1] - step[d, 1] - py, x[d, 2] - step[d, 2] - pz
    mx, my, mz = quarter * (ax + bx + cx + dx), quarter * (ay + by + cy + dy), quarter * (az + bz + cz + dz)
    sx, sy, sz = quarter * (bx + cx - ax - dx), quarter * (by + cy - ay - dy), quarter * (bz + cz - az - dz)
    tx, ty, tz = quarter * (cx + dx - ax - bx), quarter * (cy + dy - ay - by), quarter * (cz + dz - az - bz)
    wx, wy, wz = quarter * (ax + cx - bx - dx), quarter * (ay + cy - by - dy), quarter * (az + cz - bz - dz)
    for _ in range(8):
        ux, uy, uz = sx + v * wx, sy + v * wy, sz + v * wz
        vx, vy, vz = tx + u * wx, ty + u * wy, tz + u * wz
        ex, ey, ez = mx + u * sx + v * vx, my + u * sy + v * vy, mz + u * sz + v * vz
        uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
        gu, gv = ex * ux + ey * uy + ez * uz, ex * vx + ey * vy + ez * vz
        square = ex * ex + ey * ey + ez * ez
        # at a border the slope that points out of the square does not count
        free_u = abs(u) < one or gu * u > zero
        free_v = abs(v) < one or gv * v > zero
        done_u = not free_u or gu * gu < exact * uu
        done_v = not free_v or gv * gv < exact * vv
        if done_u and done_v:
            break
        if free_u and free_v:
            uv = ux * vx + uy * vy + uz * vz
            mixed = uv + ex * wx + ey * wy + ez * wz
            if mixed * mixed > np.float32(0.9) * uu * vv:
                mixed = uv
            inverse = one / (uu * vv - mixed * mixed + np.float32(1e-30))
            u -= (gu * vv - gv * mixed) * inverse
            v -= (gv * uu - gu * mixed) * inverse
        elif free_u:
            u -= gu / uu
        else:
            v -= gv / vv
        u, v = min(max(u, -one), one), min(max(v, -one), one)
    return u, v, ex, ey, ez, square, uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
