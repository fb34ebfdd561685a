"""Whether a sheet lies over a plane, every place of it over another: then it passes through itself nowhere.

If all triangles turn one way as seen from above, and the outline of their only border does not cross itself, each point
of the plane has as many triangles over it as the outline winds about it: one, or none (the degree of a map; Milnor
1965). That is told in a tenth of the time in which pairs of triangles are looked at. On a straight way from one place
to another it holds for all triangles at all times: a normal's height is a quadratic of the time, which is positive
where its three coefficients over Bernstein's polynomials are.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints
from .boxes import touching

__all__ = ["outline", "steepest"]

#: Height of a normal over its length that is surely positive, and a share of lengths that is surely no rounding.
_SURE, _ROUNDING = 1e-3, 1e-9


def outline(border: Ints) -> Ints | None:
    """Return the vertices of border edges (b, 2) one after the other around; None if they are not one ring."""
    if not len(border):
        return None
    order = np.argsort(border.ravel(), kind="stable")
    vertices, places = border.ravel()[order], order // 2
    if len(vertices) % 2 or (vertices[::2] != vertices[1::2]).any() or (vertices[2::2] == vertices[1:-1:2]).any():
        return None
    found = _around(border, np.searchsorted(vertices, border), places.reshape(-1, 2))
    return found if len(found) == len(border) else None


@njit(cache=True)
def _around(border: Ints, row: Ints, edges: Ints) -> Ints:
    """Return vertices in turn; row (b, 2): which of `edges` (v, 2), the two edges at each vertex, is each end's."""
    found = np.empty(len(border), np.int64)
    edge, end = 0, 0
    for k in range(len(border)):
        found[k] = border[edge, end]
        place = row[edge, 1 - end]
        vertex = border[edge, 1 - end]
        edge = edges[place // 2, 0] if edges[place // 2, 0] != edge else edges[place // 2, 1]
        end = 0 if border[edge, 0] == vertex else 1
        if edge == 0:
            return found[: k + 1].copy()
    return found


def steepest(x: Floats, y: Floats, triangles: Ints, rim: Ints, looks: int) -> tuple[float, Floats]:
    """Return the least cosine of a triangle's slope over a plane on the straight way from x to y, and the plane's axes.

    x, y: (n, 3). rim: vertices of the outline in turn, which is looked at so many times on the way, y first. The cosine
    is 0 where it is not shown that every place lies over another. axes (2, 3).
    """
    total = _area(x, triangles) + _area(y, triangles)
    size = float(np.linalg.norm(total))
    if not size > 0:
        return 0.0, np.zeros((2, 3))
    up = total / size
    first = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(up, first)])
    least = _least_cosine(x, y, triangles, up)
    if not least > _SURE:
        return 0.0, axes
    begin, end = x[rim] @ axes.T, y[rim] @ axes.T
    for k in range(looks):
        if _crosses(end - k / looks * (end - begin)):
            return 0.0, axes
    return least, axes


@njit(cache=True, error_model="numpy")
def _area(x: Floats, triangles: Ints) -> Floats:
    """Return twice the area of triangles as a vector (3,)."""
    found = np.zeros(3)
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        bx, by, bz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        found[0] += ay * bz - az * by
        found[1] += az * bx - ax * bz
        found[2] += ax * by - ay * bx
    return found


@njit(cache=True, error_model="numpy")
def _least_cosine(x: Floats, y: Floats, triangles: Ints, up: Floats) -> float:
    """Return the least height of a normal over its length, of Bernstein's three coefficients on the way."""
    least = np.inf
    a, b, c, d, n = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for h in range(3):
            a[h], b[h] = x[j, h] - x[i, h], x[k, h] - x[i, h]
            c[h], d[h] = y[j, h] - y[i, h], y[k, h] - y[i, h]
        for stage in range(3):
            for h in range(3):
                f, g = (h + 1) % 3, (h + 2) % 3
                if stage == 0:
                    n[h] = a[f] * b[g] - a[g] * b[f]
                elif stage == 1:
                    n[h] = 0.5 * (a[f] * d[g] - a[g] * d[f] + c[f] * b[g] - c[g] * b[f])
                else:
                    n[h] = c[f] * d[g] - c[g] * d[f]
            height = n[0] * up[0] + n[1] * up[1] + n[2] * up[2]
            size = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
            # a triangle without area has no way up
            cosine = height / size if size > 0 else 0.0
            if not cosine >= least:
                least = cosine
        if not least > 0:
            return 0.0
    return least


def _crosses(ring: Floats) -> bool:
    """Return whether a closed line through points (v, 2) may cross or touch itself; rounding counts as if it did."""
    then = np.roll(ring, -1, axis=0)
    low, high = np.zeros((len(ring), 3)), np.zeros((len(ring), 3))
    low[:, :2], high[:, :2] = np.minimum(ring, then), np.maximum(ring, then)
    pairs = touching(low, high)
    return bool(_meet(ring, pairs).any()) or bool(_spikes(ring).any())


@njit(cache=True, error_model="numpy")
def _meet(ring: Floats, pairs: Ints) -> Bools:
    """Return which pairs (m, 2) of the line's parts that are not next to each other may share a point."""
    n, found = len(ring), np.zeros(len(pairs), np.bool_)
    for m in range(len(pairs)):
        i, j = pairs[m]
        if (i + 1) % n == j or (j + 1) % n == i:
            continue
        a, b, c, d = ring[i], ring[(i + 1) % n], ring[j], ring[(j + 1) % n]
        found[m] = not (_beside(a, b, c, d) or _beside(c, d, a, b))
    return found


@njit(cache=True, error_model="numpy")
def _beside(a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    """Return whether c and d are surely on one side of the line through a and b."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    p, q = ux * (c[1] - a[1]) - uy * (c[0] - a[0]), ux * (d[1] - a[1]) - uy * (d[0] - a[0])
    sure = _ROUNDING * (ux * ux + uy * uy)
    found: bool = (p > sure and q > sure) or (p < -sure and q < -sure)
    return found


def _spikes(ring: Floats) -> Bools:
    """Return where a line turns back on itself."""
    out, back = np.roll(ring, -1, axis=0) - ring, np.roll(ring, 1, axis=0) - ring
    across = np.abs(out[:, 0] * back[:, 1] - out[:, 1] * back[:, 0])
    sizes = np.hypot(*out.T) * np.hypot(*back.T)
    found: Bools = ((out * back).sum(axis=1) >= 0) & (across <= _ROUNDING * sizes)
    return found
