"""The hot loop of falling bodies: position-based rigid-body dynamics (Mueller et al. 2020, "Detailed rigid body
simulation with extended position based dynamics") with rigid contacts and Coulomb friction, one sweep a step.

A body is a radial function on directions (colatitude about y, azimuth from x to z) and points of that surface; a point
of one body within the other's radius is a contact. Inertia is that of a ball of the mean radius.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints

__all__ = ["radius_at", "rotate", "step"]

#: Share of its motion that a body in contact loses in a unit of time: it rolls a few radii on a floor.
ROLLING = 1.5


@njit(cache=True, error_model="numpy")
def rotate(q: Floats, v: Floats, back: bool) -> tuple[float, float, float]:
    """Return v turned by a unit quaternion (x, y, z, w), or turned back."""
    sign = -1.0 if back else 1.0
    x, y, z, w = sign * q[0], sign * q[1], sign * q[2], q[3]
    a, b, c = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return v[0] + w * a + y * c - z * b, v[1] + w * b + z * a - x * c, v[2] + w * c + x * b - y * a


@njit(cache=True, error_model="numpy")
def radius_at(table: Floats, x: float, y: float, z: float, r: float) -> float:
    """Return the radius of a table (n, 2n) of radii by direction, bilinear, in the direction (x, y, z) / r."""
    n = table.shape[0]
    t = math.acos(min(max(y / r, -1.0), 1.0)) / math.pi * n - 0.5
    p = math.atan2(z, x) / math.pi * n
    i, j = math.floor(t), math.floor(p)
    a, b = t - i, p - j
    top, bottom = min(max(i, 0), n - 1), min(max(i + 1, 0), n - 1)
    left, right = int(j) % (2 * n), int(j + 1) % (2 * n)
    high = table[top, left] * (1 - b) + table[top, right] * b
    low = table[bottom, left] * (1 - b) + table[bottom, right] * b
    return float(high * (1 - a) + low * a)


@njit(cache=True, error_model="numpy")
def _spin(q: Floats, x: float, y: float, z: float) -> None:
    """Turn a quaternion by a small rotation vector."""
    a, b, c, w = q[0], q[1], q[2], q[3]
    q[0] += 0.5 * (x * w + y * c - z * b)
    q[1] += 0.5 * (y * w + z * a - x * c)
    q[2] += 0.5 * (z * w + x * b - y * a)
    q[3] -= 0.5 * (x * a + y * b + z * c)
    q /= math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)


@njit(cache=True, error_model="numpy")
def _push(at: Floats, turn: Floats, i: int, arm: Floats, d: Floats, amount: float, mass: float, inertia: float) -> None:
    """Move body i by an impulse of position `amount` along d at `arm`."""
    for k in range(3):
        at[i, k] += d[k] * amount / mass
    share = amount / inertia
    x = (arm[1] * d[2] - arm[2] * d[1]) * share
    y = (arm[2] * d[0] - arm[0] * d[2]) * share
    z = (arm[0] * d[1] - arm[1] * d[0]) * share
    _spin(turn[i], x, y, z)


@njit(cache=True, error_model="numpy")
def _ease(arm: Floats, d: Floats, mass: float, inertia: float) -> float:
    """Return how far the point at `arm` gives way along d to a unit impulse."""
    x, y, z = arm[1] * d[2] - arm[2] * d[1], arm[2] * d[0] - arm[0] * d[2], arm[0] * d[1] - arm[1] * d[0]
    return float(1 / mass + (x * x + y * y + z * z) / inertia)


@njit(cache=True, error_model="numpy")
def _resolve(
    at: Floats, turn: Floats, before: Floats, turned: Floats, pair: tuple[int, int], point: Floats, normal: Floats,
    depth: float, mass: Floats, inertia: Floats, friction: float,
) -> None:  # fmt: skip
    """Part bodies i and j (-1: what stands still) at a point along a normal towards i, and hold them by friction."""
    i, j = pair
    ri, rj = point - at[i], point - at[max(j, 0)]
    give = _ease(ri, normal, mass[i], inertia[i])
    if j >= 0:
        give += _ease(rj, normal, mass[j], inertia[j])
    push = depth / give
    # how the touching points have moved past each other in this step
    slip = np.empty(3)
    local = np.empty(3)
    local[0], local[1], local[2] = rotate(turn[i], ri, True)
    old = rotate(turned[i], local, False)
    for k in range(3):
        slip[k] = at[i, k] + ri[k] - before[i, k] - old[k]
    if j >= 0:
        local[0], local[1], local[2] = rotate(turn[j], rj, True)
        old = rotate(turned[j], local, False)
        for k in range(3):
            slip[k] -= at[j, k] + rj[k] - before[j, k] - old[k]
    slip -= normal * np.dot(slip, normal)
    _push(at, turn, i, ri, normal, push, mass[i], inertia[i])
    if j >= 0:
        _push(at, turn, j, rj, normal, -push, mass[j], inertia[j])
    length = math.sqrt(np.dot(slip, slip))
    if length < 1e-12:
        return
    along = slip / length
    give = _ease(ri, along, mass[i], inertia[i])
    if j >= 0:
        give += _ease(rj, along, mass[j], inertia[j])
    hold = min(length / give, friction * push)
    _push(at, turn, i, ri, along, -hold, mass[i], inertia[i])
    if j >= 0:
        _push(at, turn, j, rj, along, hold, mass[j], inertia[j])


@njit(cache=True, error_model="numpy")
def _meet(
    at: Floats, turn: Floats, i: int, j: int, points: Floats, table: Floats, reach: float, scale: tuple[float, float],
    point: Floats, normal: Floats,
) -> float:  # fmt: skip
    """Find the point of body i that is deepest in body j: returns the depth, and fills the point and the normal."""
    deepest, best = 0.0, -1
    offset = at[i] - at[j]
    moved, local = np.empty(3), np.empty(3)
    # most points are out of reach: told in the body's own frame, where they need no turning
    x, y, z = rotate(turn[i], offset, True)
    most = reach * reach
    for k in range(len(points)):
        u, v, w = points[k, 0] * scale[0] + x, points[k, 1] * scale[0] + y, points[k, 2] * scale[0] + z
        square = u * u + v * v + w * w
        if square >= most or square < 1e-18:
            continue
        moved[0], moved[1], moved[2] = u, v, w
        moved[0], moved[1], moved[2] = rotate(turn[i], moved, False)
        r = math.sqrt(square)
        local[0], local[1], local[2] = rotate(turn[j], moved, True)
        depth = radius_at(table, local[0], local[1], local[2], r) * scale[1] - r
        if depth > deepest:
            deepest, best = depth, k
            point[:] = moved + at[j]
    if best < 0:
        return 0.0
    # outwards from j: against the slope of its radius, by differences of the signed distance along the radius
    for c in range(3):
        moved[c] = point[c] - at[j, c]
    r = math.sqrt(moved[0] ** 2 + moved[1] ** 2 + moved[2] ** 2)
    local[0], local[1], local[2] = rotate(turn[j], moved, True)
    h = 0.15 * r
    slope = np.empty(3)
    for c in range(3):
        kept = local[c]
        local[c] = kept + h
        up = math.sqrt(local[0] ** 2 + local[1] ** 2 + local[2] ** 2)
        high = up - radius_at(table, local[0], local[1], local[2], up) * scale[1]
        local[c] = kept - h
        up = math.sqrt(local[0] ** 2 + local[1] ** 2 + local[2] ** 2)
        slope[c] = high - up + radius_at(table, local[0], local[1], local[2], up) * scale[1]
        local[c] = kept
    slope /= math.sqrt(slope[0] ** 2 + slope[1] ** 2 + slope[2] ** 2) + 1e-12
    normal[0], normal[1], normal[2] = rotate(turn[j], slope, False)
    # the depth was along the radius
    lean = (normal[0] * moved[0] + normal[1] * moved[1] + normal[2] * moved[2]) / r
    return float(deepest * max(lean, 0.2))


@njit(cache=True, error_model="numpy")
def _ground(
    at: Floats, turn: Floats, i: int, points: Floats, scale: float, reach: float, bowl: Floats, point: Floats,
    normal: Floats,
) -> float:  # fmt: skip
    """Find the point of body i that is deepest in the floor y = 0 or in the bowl's shell.

    bowl: radius of the inner sphere, thickness, height of the rim; radius 0 is no bowl. The inner sphere's lowest point
    lies `thickness` above the floor.
    """
    deepest = 0.0
    cy = at[i, 1] - bowl[0] - bowl[1]
    away = math.sqrt(at[i, 0] ** 2 + cy * cy + at[i, 2] ** 2)
    # most bodies of a heap are far from both
    clear = bowl[0] <= 0 or at[i, 1] - reach > bowl[2] or away + reach < bowl[0]
    if at[i, 1] > reach and clear:
        return 0.0
    # which side it came from, the body's centre says
    within = away < bowl[0] + 0.5 * bowl[1]
    moved = np.empty(3)
    for k in range(len(points)):
        moved[0], moved[1], moved[2] = rotate(turn[i], points[k], False)
        for c in range(3):
            moved[c] = moved[c] * scale + at[i, c]
        if -moved[1] > deepest:
            deepest = -moved[1]
            point[:] = moved
            normal[0], normal[1], normal[2] = 0.0, 1.0, 0.0
        if bowl[0] <= 0 or moved[1] > bowl[2]:
            continue
        y = moved[1] - bowl[0] - bowl[1]
        r = math.sqrt(moved[0] ** 2 + y * y + moved[2] ** 2)
        inner, outer = r - bowl[0], bowl[0] + bowl[1] - r
        depth = inner if within else outer
        if depth > deepest:
            deepest = depth
            point[:] = moved
            side = -1.0 if within else 1.0
            normal[0], normal[1], normal[2] = side * moved[0] / r, side * y / r, side * moved[2] / r
    return deepest


@njit(cache=True, error_model="numpy")
def _speeds(
    at: Floats, turn: Floats, speed: Floats, spin: Floats, before: Floats, turned: Floats, touching: Bools, h: float
) -> float:
    """Find speeds and spins from where bodies were a step of h ago, less what rolling loses; return the fastest."""
    fastest = 0.0
    for i in range(len(at)):
        for k in range(3):
            speed[i, k] = (at[i, k] - before[i, k]) / h
        # the turn of this step: q q0^-1
        q, p = turn[i], turned[i]
        w = q[3] * p[3] + q[0] * p[0] + q[1] * p[1] + q[2] * p[2]
        sign = 2 / h if w >= 0 else -2 / h
        spin[i, 0] = sign * (-q[3] * p[0] + q[0] * p[3] - q[1] * p[2] + q[2] * p[1])
        spin[i, 1] = sign * (-q[3] * p[1] + q[1] * p[3] - q[2] * p[0] + q[0] * p[2])
        spin[i, 2] = sign * (-q[3] * p[2] + q[2] * p[3] - q[0] * p[1] + q[1] * p[0])
        size = math.sqrt(speed[i, 0] ** 2 + speed[i, 1] ** 2 + speed[i, 2] ** 2)
        # soft skins roll with losses
        if touching[i]:
            speed[i] *= 1 - ROLLING * h
            spin[i] *= 1 - ROLLING * h
        # parting what overlapped is no motion to go on with
        if size > 12.0:
            speed[i] *= 12.0 / size
        fastest = max(fastest, size)
    return fastest


# takes seconds: other threads of a service go on
@njit(cache=True, error_model="numpy", nogil=True)
def step(
    at: Floats, turn: Floats, speed: Floats, spin: Floats, kind: Ints, scale: Floats, tables: Floats, points: Floats,
    reach: Floats, mass: Floats, inertia: Floats, bowl: Floats, h: float, drag: float, friction: float, count: int,
) -> float:  # fmt: skip
    """Advance all bodies by `count` steps of h under gravity 1 and return the largest speed of the last one.

    at, speed, spin: (body, 3); turn: (body, 4); kind: (body); tables: (kind, n, 2n); points: (kind, m, 3) of size 1.
    reach: (body) radius of the ball around it.
    """
    n = len(at)
    before, turned = np.empty_like(at), np.empty_like(turn)
    point, normal = np.empty(3), np.empty(3)
    touching = np.zeros(n, np.bool_)
    fastest = 0.0
    for _ in range(count):
        before[:], turned[:] = at, turn
        touching[:] = False
        for i in range(n):
            speed[i, 1] -= h
            for k in range(3):
                speed[i, k] *= 1 - drag * h
                spin[i, k] *= 1 - drag * h
                at[i, k] += speed[i, k] * h
            _spin(turn[i], spin[i, 0] * h, spin[i, 1] * h, spin[i, 2] * h)
        for i in range(n):
            for j in range(i):
                gap = reach[i] + reach[j]
                x, y, z = at[i, 0] - at[j, 0], at[i, 1] - at[j, 1], at[i, 2] - at[j, 2]
                if x * x + y * y + z * z >= gap * gap:
                    continue
                for a, b in ((i, j), (j, i)):
                    sizes = (scale[a], scale[b])
                    depth = _meet(at, turn, a, b, points[kind[a]], tables[kind[b]], reach[b], sizes, point, normal)
                    if depth > 0:
                        touching[a] = touching[b] = True
                        _resolve(at, turn, before, turned, (a, b), point, normal, depth, mass, inertia, friction)
        for i in range(n):
            for _again in range(3):
                depth = _ground(at, turn, i, points[kind[i]], scale[i], reach[i], bowl, point, normal)
                if depth <= 0:
                    break
                touching[i] = True
                _resolve(at, turn, before, turned, (i, -1), point, normal, depth, mass, inertia, friction)
        fastest = _speeds(at, turn, speed, spin, before, turned, touching, h)
    return fastest
