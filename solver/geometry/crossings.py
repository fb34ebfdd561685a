"""Where a triangle mesh passes through itself: the pairs of triangles that cross, and how deep.

Two triangles cross where they share more than touching points: each has corners strictly on both sides of the other's
plane, and the two stretches of the planes' common line that they cover overlap in more than a point (Moeller 1997,
doi 10.1080/10867651.1997.10487472; decided by orientations alone, Guigue & Devillers 2003, doi
10.1080/10867651.2003.10487580). Every decision is the sign of a determinant of four corners. A sign counts only where
rounding cannot have made it (Shewchuk 1997, doi 10.1007/PL00009321, his bound A); otherwise it is 0, and 0 never
counts as being on a side. So touching corners, edges and faces are no crossing, no pair is reported that does not
cross, and one that is missed crosses by less than about 1e-15 of its distance from the origin.
Triangles that share a corner are no pair: a mesh that folds over an edge of its own crosses with the next triangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from .boxes import LEAF, leaf_pairs, sort_boxes

__all__ = ["Crossings", "crossings", "depth_of", "split_quads"]

Doubles = NDArray[np.float64]
Longs = NDArray[np.int64]

_BOUND = (7 + 56 * 2.0**-53) * 2.0**-53
"""Largest rounding error of an orientation, as a share of the sum of the absolute products in it."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Pairs of crossing triangles."""

    pairs: Longs
    """(nx, 2) triangles, first < second, ascending"""
    depths: Doubles
    """(nx,) least distance by which one triangle of the pair must move to leave the other, in the units of positions"""

    @property
    def count(self) -> int:
        """Number of pairs."""
        return len(self.pairs)

    @property
    def depth(self) -> float:
        """Largest of `depths`, 0 if nothing crosses.

        A lower bound of how deep parts have gone through each other once whole triangles have: those cross nothing.
        """
        return float(self.depths.max(initial=0.0))


def split_quads(quads: ArrayLike) -> Longs:
    """Return the triangles (2 nq, 3) of quads (nq, 4), cut from their first corner to their third."""
    faces = np.asarray(quads, np.int64)
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


def crossings(positions: ArrayLike, triangles: ArrayLike) -> Crossings:
    """Find all pairs of triangles without a common corner that cross.

    positions: (nv, >= 3). triangles: (nt, 3) corners. 100,000 triangles of a smooth surface take about 0.1 s.

    Raises ValueError for positions that are not finite or corners that do not exist.
    """
    x = np.ascontiguousarray(np.asarray(positions, np.float64)[:, :3])
    faces = np.ascontiguousarray(triangles, np.int64)
    if not np.isfinite(x).all():
        raise ValueError("crossings needs finite positions")
    if faces.ndim != 2 or faces.shape[1] != 3 or (faces.size and not 0 <= faces.min() <= faces.max() < len(x)):
        raise ValueError(f"triangles must be (nt, 3) numbers of {len(x)} positions")
    low, high = _boxes(x, faces)
    tree = sort_boxes(low, high)
    # in the order of the leaves everything is read in a row
    sorted_faces = faces[tree.order]
    places, depths = _cross(x, sorted_faces, low[tree.order], high[tree.order], leaf_pairs(tree), LEAF)
    pairs = np.sort(tree.order[places], axis=1)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return Crossings(pairs[order], depths[order])


@njit(cache=True, error_model="numpy")
def _boxes(x: Doubles, faces: Longs) -> tuple[Doubles, Doubles]:
    """Least and largest coordinates of each triangle, both (nt, 3)."""
    low, high = np.empty((len(faces), 3)), np.empty((len(faces), 3))
    for t in range(len(faces)):
        for k in range(3):
            a, b, c = x[faces[t, 0], k], x[faces[t, 1], k], x[faces[t, 2], k]
            low[t, k], high[t, k] = min(a, b, c), max(a, b, c)
    return low, high


@njit(cache=True, error_model="numpy")
def _cross(x: Doubles, faces: Longs, low: Doubles, high: Doubles, leaves: Longs, leaf: int) -> tuple[Longs, Doubles]:
    """Crossing pairs (nx, 2) and their depths among the triangles of all pairs of leaves.

    leaf: `LEAF`, handed in because numba's cache does not see when a constant of another file changes.
    """
    found, depths, count = np.empty((64, 2), np.int64), np.empty(64), 0
    p, q = np.empty((3, 3)), np.empty((3, 3))
    for pair in range(len(leaves)):
        first, second = leaves[pair, 0] * leaf, leaves[pair, 1] * leaf
        for a in range(first, min(first + leaf, len(faces))):
            for b in range(a + 1 if first == second else second, min(second + leaf, len(faces))):
                if (
                    low[a, 0] > high[b, 0] or low[b, 0] > high[a, 0]
                    or low[a, 1] > high[b, 1] or low[b, 1] > high[a, 1]
                    or low[a, 2] > high[b, 2] or low[b, 2] > high[a, 2]
                    or _neighbours(faces, a, b)
                ):  # fmt: skip
                    continue
                for i in range(3):
                    for k in range(3):
                        p[i, k], q[i, k] = x[faces[a, i], k], x[faces[b, i], k]
                if not cross(p, q):
                    continue
                if count == len(found):
                    found, depths = np.concatenate((found, found)), np.concatenate((depths, depths))
                found[count, 0], found[count, 1], depths[count] = a, b, depth_of(p, q)
                count += 1
    return found[:count], depths[:count]


@njit(cache=True, error_model="numpy")
def _neighbours(faces: Longs, a: int, b: int) -> bool:
    for i in range(3):
        for j in range(3):
            if faces[a, i] == faces[b, j]:
                return True
    return False


@njit(cache=True, error_model="numpy")
def side(a: Doubles, b: Doubles, c: Doubles, d: Doubles) -> int:
    """Side of the plane abc on which d lies: 1 where abc turns counter-clockwise seen from d, 0 within rounding."""
    ax, ay, az = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    bx, by, bz = b[0] - d[0], b[1] - d[1], b[2] - d[2]
    cx, cy, cz = c[0] - d[0], c[1] - d[1], c[2] - d[2]
    bc, cb, ca, ac, ab, ba = bx * cy, cx * by, cx * ay, ax * cy, ax * by, bx * ay
    determinant = az * (bc - cb) + bz * (ca - ac) + cz * (ab - ba)
    size = (abs(bc) + abs(cb)) * abs(az) + (abs(ca) + abs(ac)) * abs(bz) + (abs(ab) + abs(ba)) * abs(cz)
    if determinant > _BOUND * size:
        return -1
    return 1 if -determinant > _BOUND * size else 0


@njit(cache=True, error_model="numpy")
def _lone(p: int, q: int, r: int) -> int:
    """Corner that is alone on its side of a plane, given the sides of all three, or -1 if the plane is not crossed.

    Where one corner lies in the plane, either of the other two will do: the stretch is the same.
    """
    if not (max(p, q, r) > 0 and min(p, q, r) < 0):
        return -1
    if p * r > 0:
        return 1
    if p * q > 0:
        return 2
    return 0 if p != 0 else 1


@njit(cache=True, error_model="numpy")
def cross(a: Doubles, b: Doubles) -> bool:
    """Whether the triangles a and b, each (3, 3) corners by row, share more than touching points."""
    p, q, r = (side(b[0], b[1], b[2], a[0]), side(b[0], b[1], b[2], a[1]), side(b[0], b[1], b[2], a[2]))
    i = _lone(p, q, r)
    if i < 0:
        return False
    above = (p, q, r)[i] > 0
    p, q, r = (side(a[0], a[1], a[2], b[0]), side(a[0], a[1], a[2], b[1]), side(a[0], a[1], a[2], b[2]))
    j = _lone(p, q, r)
    if j < 0:
        return False
    over = (p, q, r)[j] > 0
    # the lone corner first, and turned so that each sees the other counter-clockwise
    p1, q1, r1 = a[i], a[(i + 1) % 3], a[(i + 2) % 3]
    p2, q2, r2 = b[j], b[(j + 1) % 3], b[(j + 2) % 3]
    if not above:
        q2, r2 = r2, q2
    if not over:
        q1, r1 = r1, q1
    return side(p1, q1, p2, q2) < 0 and side(p1, r1, r2, p2) < 0


@njit(cache=True, error_model="numpy")
def _overlap(a: Doubles, b: Doubles, nx: float, ny: float, nz: float) -> float:
    """By how much the triangles overlap along a direction, the shorter way out; infinite if it has no length."""
    square = nx * nx + ny * ny + nz * nz
    if square == 0:
        return math.inf
    least_a = least_b = math.inf
    most_a = most_b = -math.inf
    for k in range(3):
        x = nx * a[k, 0] + ny * a[k, 1] + nz * a[k, 2]
        y = nx * b[k, 0] + ny * b[k, 1] + nz * b[k, 2]
        least_a, most_a, least_b, most_b = min(least_a, x), max(most_a, x), min(least_b, y), max(most_b, y)
    return max(min(most_a - least_b, most_b - least_a), 0.0) / math.sqrt(square)


@njit(cache=True, error_model="numpy")
def depth_of(a: Doubles, b: Doubles) -> float:
    """Least distance by which the triangle a must move to leave b; both (3, 3).

    The shortest way out of the sum of a and -b, whose faces are parallel to a, to b or to an edge of each.
    """
    depth = math.inf
    for t in (a, b):
        ux, uy, uz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
        vx, vy, vz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
        depth = min(depth, _overlap(a, b, uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx))
    for i in range(3):
        ux, uy, uz = a[i, 0] - a[i - 1, 0], a[i, 1] - a[i - 1, 1], a[i, 2] - a[i - 1, 2]
        size = ux * ux + uy * uy + uz * uz
        for j in range(3):
            vx, vy, vz = b[j, 0] - b[j - 1, 0], b[j, 1] - b[j - 1, 1], b[j, 2] - b[j - 1, 2]
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            # parallel edges span no face: their product is rounding
            if nx * nx + ny * ny + nz * nz > 1e-20 * size * (vx * vx + vy * vy + vz * vz):
                depth = min(depth, _overlap(a, b, nx, ny, nz))
    return depth
