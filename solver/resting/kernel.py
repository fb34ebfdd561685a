"""The hot loop of falling bodies: position-based rigid-body dynamics (Mueller et al. 2020, "Detailed rigid body
simulation with extended position based dynamics") with rigid contacts and Coulomb friction, one sweep a step.

Where bodies touch is told by `near`. Inertia is that of a ball of the mean radius.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints
from .near import (
    NEAR,
    SKIN,
    SLACK,
    are_apart,
    caps_of,
    deepest_in,
    deepest_in_ground,
    moved,
    note,
    outwards,
    pairs_of,
    rotate,
    slopes,
)  # fmt: skip

__all__ = ["step"]

#: Share of its motion that a body in contact loses in a unit of time: it rolls a few radii on a floor.
ROLLING = 1.5


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


@njit(cache=True, error_model="numpy")
def _part(
    at: Floats, turn: Floats, before: Floats, turned: Floats, a: int, b: int, kind: Ints, scale: Floats,
    tables: Floats, caps: Floats, points: Floats, mass: Floats, inertia: Floats, friction: float, near: Ints,
    depths: Floats, known: int, slack: float, point: Floats, normal: Floats,
) -> tuple[bool, int]:  # fmt: skip
    """Part body a from body b; return whether they touched, and how many points are listed as near."""
    sizes, table, of = (scale[a], scale[b]), tables[kind[b]], points[kind[a]]
    depth, listed = deepest_in(at, turn, a, b, of, table, caps[kind[b]], sizes, near, depths, known, slack, point)
    if depth <= 0:
        return False, listed
    depth = outwards(at, turn, b, table, scale[b], depth, point, normal)
    _resolve(at, turn, before, turned, (a, b), point, normal, depth, mass, inertia, friction)
    return True, listed


@njit(cache=True, error_model="numpy")
def _fall(at: Floats, turn: Floats, speed: Floats, spin: Floats, h: float, drag: float) -> None:
    """Move all bodies on for a step of h, as if nothing were in their way."""
    for i in range(len(at)):
        speed[i, 1] -= h
        for k in range(3):
            speed[i, k] *= 1 - drag * h
            spin[i, k] *= 1 - drag * h
            at[i, k] += speed[i, k] * h
        _spin(turn[i], spin[i, 0] * h, spin[i, 1] * h, spin[i, 2] * h)


@njit(cache=True, error_model="numpy")
def _farthest(at: Floats, there: Floats) -> float:
    """Return the square of how far the farthest body has moved from where it was."""
    farthest = 0.0
    for i in range(len(at)):
        square = 0.0
        for k in range(3):
            square += (at[i, k] - there[i, k]) ** 2
        farthest = max(farthest, square)
    return farthest


@njit(cache=True, error_model="numpy")
def _lift(
    at: Floats, turn: Floats, before: Floats, turned: Floats, points: Floats, i: int, scale: float, reach: float,
    mass: Floats, inertia: Floats, bowl: Floats, friction: float, pose: Floats, near: Ints, depths: Floats, known: int,
    point: Floats, normal: Floats,
) -> tuple[bool, int]:  # fmt: skip
    """Lift body i out of what stands still; return whether it touches that, and how many points are listed as near."""
    touches = False
    for _ in range(3):
        slack = SLACK
        if known >= 0:
            slack = moved(at, turn, i, -1, (reach, 0.0), pose)
        is_new = known < 0 or slack > SLACK
        if is_new:
            known, slack = -1, SLACK
            note(at, turn, i, -1, pose)
        depth, listed = deepest_in_ground(
            at, turn, i, points, scale, reach, bowl, point, normal, near, depths, known, slack
        )
        if is_new:
            known = listed
        if depth <= 0:
            break
        touches = True
        _resolve(at, turn, before, turned, (i, -1), point, normal, depth, mass, inertia, friction)
    return touches, known


# takes seconds: other threads of a service go on
@njit(cache=True, error_model="numpy", nogil=True)
def step(
    at: Floats, turn: Floats, speed: Floats, spin: Floats, kind: Ints, scale: Floats, tables: Floats, points: Floats,
    reach: Floats, mass: Floats, inertia: Floats, bowl: Floats, h: float, drag: float, friction: float, count: int,
) -> float:  # fmt: skip
    """Advance all bodies by `count` steps of h under gravity 1 and return the largest speed of the last one.

    at, speed, spin: (body, 3); turn: (body, 4); kind: (body); tables: (kind, n, 2n); points: (kind, m, 3) of size 1.
    reach: (body) radius of the ball around it. Which bodies and which of their points are near each other is found anew
    when they have moved that far that it may have changed: most of a heap lies still.
    """
    n = len(at)
    before, turned = np.empty_like(at), np.empty_like(turn)
    point, normal = np.empty(3), np.empty(3)
    touching = np.zeros(n, np.bool_)
    fastest = 0.0
    steep, caps = slopes(tables), caps_of(tables)
    pairs, there = np.empty((0, 2), np.int64), np.full_like(at, np.inf)
    poses, near, known = np.empty((0, 2, 11)), np.empty((0, 2, NEAR), np.int64), np.empty((0, 2), np.int64)
    depths = np.empty((0, 2, NEAR))
    poses_down, near_down, known_down = np.empty((n, 11)), np.empty((n, NEAR), np.int64), np.full(n, -1)
    depths_down = np.empty((n, NEAR))
    for _ in range(count):
        before[:], turned[:] = at, turn
        touching[:] = False
        _fall(at, turn, speed, spin, h, drag)
        if _farthest(at, there) > (0.25 * SKIN) ** 2:  # the rest of the room is for moves within a step
            there[:] = at
            pairs = pairs_of(at, reach, SKIN)
            poses, near = np.empty((len(pairs), 2, 11)), np.empty((len(pairs), 2, NEAR), np.int64)
            depths, known = np.empty((len(pairs), 2, NEAR)), np.full((len(pairs), 2), -1)
        for p in range(len(pairs)):
            i, j = pairs[p]
            if are_apart(at, i, j, reach[i] + reach[j]):
                continue
            for side in range(2):
                a, b = (i, j) if side == 0 else (j, i)
                pose, slack = poses[p, side], SLACK
                if known[p, side] >= 0:
                    slack = moved(at, turn, a, b, (reach[a], reach[b] + SLACK), pose) * steep[kind[b]]
                if known[p, side] < 0 or slack > SLACK:
                    known[p, side], slack = -1, SLACK
                    note(at, turn, a, b, pose)
                elif not known[p, side]:
                    continue
                touches, listed = _part(
                    at, turn, before, turned, a, b, kind, scale, tables, caps, points, mass, inertia, friction,
                    near[p, side], depths[p, side], known[p, side], slack, point, normal,
                )  # fmt: skip
                if known[p, side] < 0:
                    known[p, side] = listed
                if touches:
                    touching[i] = touching[j] = True
        for i in range(n):
            touches, known_down[i] = _lift(
                at, turn, before, turned, points[kind[i]], i, scale[i], reach[i], mass, inertia, bowl, friction,
                poses_down[i], near_down[i], depths_down[i], known_down[i], point, normal,
            )  # fmt: skip
            touching[i] = touching[i] or touches
        fastest = _speeds(at, turn, speed, spin, before, turned, touching, h)
    return fastest
