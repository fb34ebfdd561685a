"""How deep a point is in a body, in the body's own frame, and which of an edge's points may be in it.

Of box, cylinder, ball and wedge the depth is the distance from the surface, exactly, and the normal its slope. Of a
mesh the depth is known at the nodes of a grid and linear between them in every direction; force and energy belong to
each other there, too, as the normal is this depth's slope, which is of unit length only to the grid's accuracy.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import BOX, CYLINDER, MESH, WEDGE, Bodies, Depths

__all__ = ["apart", "depth", "eased", "points", "sampled", "touch"]

#: Depth [m] and outward normal.
Touch = tuple[float, float, float, float]


@njit(cache=True, error_model="numpy")
def touch(bodies: Bodies, r: int, o0: float, o1: float, o2: float) -> Touch:
    """Return depth [m] (0: apart) and outward normal in body r at o from its centre [m], all in its own frame."""
    if bodies.kind[r] == MESH:
        return sampled(bodies.depths, r, o0, o1, o2)
    half, edge = bodies.half[r], bodies.edge[r]
    return depth(bodies.kind[r], bodies.axis[r], half[0], half[1], half[2], edge[0], edge[1], edge[2], o0, o1, o2)


@njit(cache=True, error_model="numpy")
def depth(
    kind: int,
    axis: int,
    h0: float,
    h1: float,
    h2: float,
    g0: float,
    g1: float,
    g2: float,
    o0: float,
    o1: float,
    o2: float,
) -> Touch:
    """Return what `touch` does, of no mesh; h and g: the rows of `half` and `edge`. Arrays would cost more than all."""
    if kind == BOX:
        return _box(h0, h1, h2, o0, o1, o2)
    if kind == CYLINDER:
        return _cylinder(axis, h0, h1, o0, o1, o2)
    if kind == WEDGE:
        return _wedge(h0, h1, h2, g0, g1, g2, o0, o1, o2)
    away = np.sqrt(o0 * o0 + o1 * o1 + o2 * o2)
    if away >= h0 or away == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    return h0 - away, o0 / away, o1 / away, o2 / away


@njit(cache=True, error_model="numpy")
def _box(h0: float, h1: float, h2: float, o0: float, o1: float, o2: float) -> Touch:
    g0 = h0 - abs(o0)
    g1 = h1 - abs(o1)
    g2 = h2 - abs(o2)
    gap = min(g0, min(g1, g2))
    if gap <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if gap == g2:
        return gap, 0.0, 0.0, 1.0 if o2 > 0 else -1.0
    if gap == g1:
        return gap, 0.0, 1.0 if o1 > 0 else -1.0, 0.0
    return gap, 1.0 if o0 > 0 else -1.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def _cylinder(axis: int, radius: float, half: float, o0: float, o1: float, o2: float) -> Touch:
    along = o0 if axis == 0 else (o1 if axis == 1 else o2)
    cap = half - abs(along)
    c0 = 0.0 if axis == 0 else o0
    c1 = 0.0 if axis == 1 else o1
    c2 = 0.0 if axis == 2 else o2
    away = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    gap = radius - away
    if cap <= 0.0 or gap <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if gap > cap and away > 0.0:
        side = 1.0 if along > 0 else -1.0
        return cap, side if axis == 0 else 0.0, side if axis == 1 else 0.0, side if axis == 2 else 0.0
    if away == 0.0:
        return gap, 0.0, 0.0 if axis != 2 else 1.0, 1.0 if axis != 2 else 0.0
    return gap, c0 / away, c1 / away, c2 / away


@njit(cache=True, error_model="numpy")
def _wedge(
    h0: float, h1: float, h2: float, radius: float, sine: float, cosine: float, o0: float, o1: float, o2: float
) -> Touch:
    """The edge runs along y, rounded about a line `radius` above the lowest; its sides part from there upwards."""
    cap = h1 - abs(o1)
    back = h2 - o2
    flank = h0 - abs(o0)
    side = 1.0 if o0 >= 0.0 else -1.0
    across = abs(o0)
    up = o2 + h2 - radius
    if across * sine + up * cosine < 0.0:
        away = np.sqrt(across * across + up * up)
        bevel = radius - away
        n0, n2 = (across / away, up / away) if away > 0.0 else (0.0, -1.0)
    else:
        bevel = radius - across * cosine + up * sine
        n0, n2 = cosine, -sine
    gap = min(min(bevel, flank), min(cap, back))
    if gap <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if gap == bevel:
        return gap, side * n0, 0.0, n2
    if gap == flank:
        return gap, side, 0.0, 0.0
    if gap == cap:
        return gap, 0.0, 1.0 if o1 > 0 else -1.0, 0.0
    return gap, 0.0, 0.0, 1.0


@njit(cache=True, error_model="numpy")
def sampled(depths: Depths, r: int, o0: float, o1: float, o2: float) -> Touch:
    """Return what `touch` does, of a mesh; the normal is the depth's slope, not of unit length."""
    n0, n1, n2 = depths.nodes[r, 0], depths.nodes[r, 1], depths.nodes[r, 2]
    step = depths.step[r]
    p, q, s = o0 / step + 0.5 * (n0 - 1), o1 / step + 0.5 * (n1 - 1), o2 / step + 0.5 * (n2 - 1)
    i, j, k = int(np.floor(p)), int(np.floor(q)), int(np.floor(s))
    if i < 0 or j < 0 or k < 0 or i > n0 - 2 or j > n1 - 2 or k > n2 - 2:
        return 0.0, 0.0, 0.0, 0.0
    p, q, s = p - i, q - j, s - k
    value, d0, d1, d2 = 0.0, 0.0, 0.0, 0.0
    for a in range(2):
        wa, sa = (p, 1.0) if a == 1 else (1.0 - p, -1.0)
        for b in range(2):
            wb, sb = (q, 1.0) if b == 1 else (1.0 - q, -1.0)
            for c in range(2):
                wc, sc = (s, 1.0) if c == 1 else (1.0 - s, -1.0)
                here = depths.value[depths.start[r] + ((i + a) * n1 + j + b) * n2 + k + c]
                value += wa * wb * wc * here
                d0 += sa * wb * wc * here
                d1 += wa * sb * wc * here
                d2 += wa * wb * sc * here
    if value <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    return value, -d0 / step, -d1 / step, -d2 / step


@njit(cache=True, error_model="numpy")
def eased(gap: float, k: float, ease: float) -> tuple[float, float]:
    """Return energy and its slope at the depth `gap`, of stiffness k that is gained over `ease`."""
    if gap < ease:
        stiff = k * gap / ease
        return stiff * gap * gap / 6.0, 0.5 * stiff * gap
    return k * (0.5 * gap * (gap - ease) + ease * ease / 6.0), k * (gap - 0.5 * ease)


@njit(cache=True, error_model="numpy")
def _slab(low: float, high: float, o: float, d: float, reach: float) -> tuple[float, float]:
    """Return which part of low to high has o + u d within +- reach."""
    p = (-reach - o) / d
    q = (reach - o) / d
    return max(low, min(p, q)), min(high, max(p, q))


@njit(cache=True, error_model="numpy")
def apart(o: float, d: float, half: float) -> bool:
    """Return whether o to o + d is beyond +- half."""
    return max(o, o + d) <= -half or min(o, o + d) >= half


@njit(cache=True, error_model="numpy")
def points(
    kind: int, axis: int, box: np.ndarray, count: int, o0: float, o1: float, o2: float, d0: float, d1: float, d2: float
) -> tuple[int, int]:
    """Return the first and one past the last of an edge's `count` points that may be in a body.

    o: its first vertex from the body's centre; d: the edge [m], both in the body's frame.
    """
    radius = box[1] if axis == 0 else box[0]
    low = 0.0
    high = 1.0
    if kind != CYLINDER or axis == 0:
        low, high = _slab(low, high, o0, d0, box[0])
        d0 = d0 if kind != CYLINDER else 0.0
    if kind != CYLINDER or axis == 1:
        low, high = _slab(low, high, o1, d1, box[1])
        d1 = d1 if kind != CYLINDER else 0.0
    if kind != CYLINDER or axis == 2:
        low, high = _slab(low, high, o2, d2, box[2])
        d2 = d2 if kind != CYLINDER else 0.0
    square = d0 * d0 + d1 * d1 + d2 * d2
    if kind == CYLINDER and square > 0.0:
        c0 = 0.0 if axis == 0 else o0
        c1 = 0.0 if axis == 1 else o1
        c2 = 0.0 if axis == 2 else o2
        mixed = c0 * d0 + c1 * d1 + c2 * d2
        under = mixed * mixed - square * (c0 * c0 + c1 * c1 + c2 * c2 - radius * radius)
        if under <= 0.0:
            return 0, 0
        root = np.sqrt(under)
        low = max(low, (-mixed - root) / square)
        high = min(high, (root - mixed) / square)
    # not so of numbers that are none, either: an edge along a slab's face
    if not low < high:
        return 0, 0
    return int(np.ceil(low * count - 0.5)), int(np.floor(high * count - 0.5)) + 1
