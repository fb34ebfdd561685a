"""Contact of edges with rigid bodies on given paths: a penalty with Coulomb friction, impulse and work accounted.

The thesis (3.2.5) reflects vertices as in elastic collisions. A penalty in the depth g has an energy of its own, so
that what a body puts in can be balanced: E = integral of k g^2 / 2 along the rods, by the midpoint rule at points fixed
on every edge. A point c = (1 - u) a + u b gives its force to both ends by the same shares: momentum is kept. The
stiffness grows from nothing over the first part of the depth, so that the force has no kink. Of a severed edge only the
feet of its stubs touch.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import Bodies, Rods

__all__ = ["apart", "eased", "points", "pose", "press", "touch"]


@njit(cache=True, error_model="numpy")
def pose(bodies: Bodies, time: float, centre: np.ndarray, speed: np.ndarray) -> None:
    """Write centres (r, 3) [m] and velocities (r, 3) [m/s] at `time` [s]; bodies rest before and after their path."""
    for r in range(len(bodies.kind)):
        n = bodies.times.shape[1]
        last = 0
        while last + 1 < n and bodies.times[r, last + 1] <= time:
            last += 1
        for c in range(3):
            centre[r, c] = bodies.points[r, last, c]
            speed[r, c] = 0.0
        if last + 1 < n and time >= bodies.times[r, last]:
            width = bodies.times[r, last + 1] - bodies.times[r, last]
            if width > 0.0:
                for c in range(3):
                    speed[r, c] = (bodies.points[r, last + 1, c] - bodies.points[r, last, c]) / width
                    centre[r, c] += speed[r, c] * (time - bodies.times[r, last])


@njit(cache=True, error_model="numpy")
def touch(
    kind: int, axis: int, reach: np.ndarray, o0: float, o1: float, o2: float
) -> tuple[float, float, float, float]:
    """Return depth [m] (0: apart) and outward normal at o from the centre [m]."""
    if kind == 0:
        g0 = reach[0] - abs(o0)
        g1 = reach[1] - abs(o1)
        g2 = reach[2] - abs(o2)
        gap = min(g0, min(g1, g2))
        if gap <= 0.0:
            return 0.0, 0.0, 0.0, 0.0
        if gap == g2:
            return gap, 0.0, 0.0, 1.0 if o2 > 0 else -1.0
        if gap == g1:
            return gap, 0.0, 1.0 if o1 > 0 else -1.0, 0.0
        return gap, 1.0 if o0 > 0 else -1.0, 0.0, 0.0
    along = o0 if axis == 0 else (o1 if axis == 1 else o2)
    cap = reach[1] - abs(along)
    c0 = 0.0 if axis == 0 else o0
    c1 = 0.0 if axis == 1 else o1
    c2 = 0.0 if axis == 2 else o2
    away = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    gap = reach[0] - away
    if cap <= 0.0 or gap <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if gap > cap and away > 0.0:
        side = 1.0 if along > 0 else -1.0
        return cap, side if axis == 0 else 0.0, side if axis == 1 else 0.0, side if axis == 2 else 0.0
    if away == 0.0:
        return gap, 0.0, 0.0 if axis != 2 else 1.0, 1.0 if axis != 2 else 0.0
    return gap, c0 / away, c1 / away, c2 / away


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

    o: its first vertex from the body's centre; d: the edge [m].
    """
    radius = box[1] if axis == 0 else box[0]
    low = 0.0
    high = 1.0
    if kind == 0 or axis == 0:
        low, high = _slab(low, high, o0, d0, box[0])
        d0 = d0 if kind == 0 else 0.0
    if kind == 0 or axis == 1:
        low, high = _slab(low, high, o1, d1, box[1])
        d1 = d1 if kind == 0 else 0.0
    if kind == 0 or axis == 2:
        low, high = _slab(low, high, o2, d2, box[2])
        d2 = d2 if kind == 0 else 0.0
    square = d0 * d0 + d1 * d1 + d2 * d2
    if kind == 1 and square > 0.0:
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
    if low >= high:
        return 0, 0
    return int(np.ceil(low * count - 0.5)), int(np.floor(high * count - 0.5)) + 1


@njit(cache=True, error_model="numpy")
def press(
    x: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    mass: np.ndarray,
    rods: Rods,
    bodies: Bodies,
    centre: np.ndarray,
    speed: np.ndarray,
    dt: float,
    push: np.ndarray,
    power: np.ndarray,
) -> float:
    """Add contact forces to f (v, 3) [N]; return the energy of the contacts [J].

    push (r, 6) gets the force [N] on each body and its moment about the centre [N m]; power[0] the power of the
    bodies, power[1] that lost by friction [W]. Friction is limited to what stops a point's share of the edge
    in half a step `dt` [s].
    """
    energy = 0.0
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        # of a severed edge the feet of its stubs
        whole = rods.alive[e] == 1
        count = bodies.first[e + 1] - bodies.first[e] if whole else 2
        share = 1.0 / count
        length = rods.rest[e] * share
        d0 = x[b, 0] - x[a, 0]
        d1 = x[b, 1] - x[a, 1]
        d2 = x[b, 2] - x[a, 2]
        for r in range(len(bodies.kind)):
            o0 = x[a, 0] - centre[r, 0]
            o1 = x[a, 1] - centre[r, 1]
            o2 = x[a, 2] - centre[r, 2]
            # most are apart; all that calls for arrays costs more
            if apart(o0, d0, bodies.box[r, 0]) or apart(o1, d1, bodies.box[r, 1]) or apart(o2, d2, bodies.box[r, 2]):
                continue
            begin, end = 0, 2
            if whole:
                begin, end = points(bodies.kind[r], bodies.axis[r], bodies.box[r], count, o0, o1, o2, d0, d1, d2)
            for q in range(begin, end):
                u = (q + 0.5) * share if whole else float(q)
                m = 1.0 - u
                gap, n0, n1, n2 = touch(
                    bodies.kind[r], bodies.axis[r], bodies.half[r], o0 + u * d0, o1 + u * d1, o2 + u * d2
                )
                if gap <= 0.0:
                    continue
                own, normal = eased(gap, bodies.k[r] * length, bodies.ease[r])
                energy += own
                s0 = m * v[a, 0] + u * v[b, 0] - speed[r, 0]
                s1 = m * v[a, 1] + u * v[b, 1] - speed[r, 1]
                s2 = m * v[a, 2] + u * v[b, 2] - speed[r, 2]
                sn = s0 * n0 + s1 * n1 + s2 * n2
                s0 -= sn * n0
                s1 -= sn * n1
                s2 -= sn * n2
                slip = np.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
                drag = 0.0
                if bodies.friction[r] > 0.0 and slip > 0.0:
                    light = share * min(mass[a], mass[b])
                    drag = min(bodies.friction[r] * normal, 0.5 * light * slip / dt) / slip
                p0 = normal * n0 - drag * s0
                p1 = normal * n1 - drag * s1
                p2 = normal * n2 - drag * s2
                f[a, 0] += m * p0
                f[a, 1] += m * p1
                f[a, 2] += m * p2
                f[b, 0] += u * p0
                f[b, 1] += u * p1
                f[b, 2] += u * p2
                push[r, 0] -= p0
                push[r, 1] -= p1
                push[r, 2] -= p2
                a0 = o0 + u * d0
                a1 = o1 + u * d1
                a2 = o2 + u * d2
                push[r, 3] -= a1 * p2 - a2 * p1
                push[r, 4] -= a2 * p0 - a0 * p2
                push[r, 5] -= a0 * p1 - a1 * p0
                power[0] += p0 * speed[r, 0] + p1 * speed[r, 1] + p2 * speed[r, 2]
                power[1] += drag * slip * slip
    return energy
