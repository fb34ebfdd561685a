"""The curve through a rod's vertices that bonds hold on to: a cubic on every edge, its slopes of second order.

On an edge e = y1 - y0 of rest length h the place at the share u is c = y0 + u e + u (1-u)^2 p - u^2 (1-u) q. Here
p = h m0 - e and q = h m1 - e are how the curve sets out and arrives other than the edge; the slopes m are those of the
parabolas through a vertex and its neighbours, by rest lengths. At a free end the parabola of the vertex before goes on;
at a clamp the slope has the clamp's direction, and is as long as the edge is stretched. Beyond its ends a curve goes
straight on.

A bond to the chord instead is stretched by a bend alone, by curvature times h^2 / 8: a bundle of uneven rods, 80 times
as long as thick, is 30 times too stiff that way with 15 vertices a rod, and within 1 % with curves.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Rods

__all__ = ["bows", "held", "slopes", "weights"]

#: Of p, then of q: parts of the neighbouring edge, of the edge itself, and of the edge along the clamp's direction that
#: make up its own; and whether the other one, negative, stands for it.
_NEXT, _OWN, _CLAMP, _MIRROR = range(4)


@njit(cache=True, error_model="numpy")
def slopes(rods: Rods) -> np.ndarray:
    """Return what p and q of every edge are made of (8, e): `_NEXT`, `_OWN`, `_CLAMP` and `_MIRROR` of p, then of q."""
    count = len(rods.a)
    beside = np.full((2, count), -1, np.int64)
    for h in range(len(rods.before)):
        if rods.whole[h] == 1:
            beside[0, rods.after[h]] = rods.before[h]
            beside[1, rods.before[h]] = rods.after[h]
    out = np.zeros((8, count))
    for e in range(count):
        if rods.k[e] == 0.0:
            continue
        for side in range(2):
            m = beside[side, e]
            if m < 0:
                out[4 * side + _MIRROR, e] = 1.0
            elif rods.k[m] == 0.0:
                out[4 * side + _OWN, e] = -1.0
                out[4 * side + _CLAMP, e] = 1.0
            else:
                part = rods.rest[e] / (rods.rest[e] + rods.rest[m])
                out[4 * side + _NEXT, e] = part * rods.rest[e] / rods.rest[m]
                out[4 * side + _OWN, e] = -part
    return out


def bows(x: np.ndarray, rods: Rods) -> tuple[np.ndarray, np.ndarray]:
    """Return p and q (e, 3) [m] of every edge of rods whose vertices are at x (v, 3) [m]."""
    made = slopes(rods)
    e = x[rods.b] - x[rods.a]
    t = e / np.linalg.norm(e, axis=1)[:, None]
    own = []
    for side, way in ((made[:4], 1), (made[4:], -1)):
        # edges of a rod have neighbouring numbers
        beside, clamp = np.roll(e, way, 0), np.roll(t, way, 0)
        along = side[_CLAMP] * (clamp * e).sum(1)
        own.append(side[_NEXT, :, None] * beside + side[_OWN, :, None] * e + along[:, None] * clamp)
    p, q = own
    return p - made[_MIRROR, :, None] * q, q - made[4 + _MIRROR, :, None] * p


def weights(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what p and q count at the shares (b,): (2, b) in the place, (2, b) in the slope."""
    v = np.clip(share, 0, 1)
    w = 1 - v
    place = np.stack([v * w * w + np.minimum(share, 0), np.maximum(share - 1, 0) - v * v * w])
    return place, np.stack([w * (1 - 3 * v), v * (3 * v - 2)])


def held(x: np.ndarray, rods: Rods, edge: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places (b, 3) [m] that bonds to `edge` (b,) at `share` (b,) hold on to, and slopes (b, 3) there."""
    p, q = (n[edge] for n in bows(x, rods))
    a, e = x[rods.a[edge]], (x[rods.b] - x[rods.a])[edge]
    place, slope = weights(share)
    here = a + share[:, None] * e + place[0][:, None] * p + place[1][:, None] * q
    return here, (e + slope[0][:, None] * p + slope[1][:, None] * q) / rods.rest[edge][:, None]
