"""Who is near whom, and which points of them: what `kernel` asks before it parts two bodies.

A body is a radial function on directions (colatitude about y, azimuth from x to z) and points of that surface; a point
of one body within the other's radius is a contact. Most of a heap lies still, so what was found to be near is tried
alone until bodies have moved so far that it may have changed. The answer is the same as without, but where a body is
pushed farther than a fifth of a radius within one step, or turns the pole of its lattice, where radii jump, to another.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..arrays import Floats, Ints

__all__ = [
    "NEAR", "SKIN", "SLACK", "are_apart", "caps_of", "deepest_in", "deepest_in_ground", "moved", "note", "outwards",
    "pairs_of", "radius_at", "rotate", "slopes",
]  # fmt: skip

#: Room around balls in which pairs are listed, and around bodies in which their points are, in units of the mean
#: radius; most points that are listed of a body; and parts of the cosine for which the largest radius is known.
SKIN, SLACK, NEAR, CAPS = 0.4, 0.12, 56, 32


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
def slopes(tables: Floats) -> Floats:
    """Return by how much a point's depth in a body of each kind may change, at most, where it moves by 1."""
    kinds, n, m = tables.shape
    found = np.empty(kinds)
    for k in range(kinds):
        steepest = 0.0
        for i in range(n):
            around = math.sin(math.pi * (i + 0.5) / n)
            for j in range(m):
                r = tables[k, i, j]
                along = (tables[k, min(i + 1, n - 1), j] - r) * n / math.pi / r
                across = (tables[k, i, (j + 1) % m] - r) * n / math.pi / around / r
                steepest = max(steepest, along * along + across * across)
        found[k] = math.sqrt(1 + steepest)
    return found


@njit(cache=True, error_model="numpy")
def caps_of(tables: Floats) -> Floats:
    """Return the largest radius of each kind by parts of the cosine of the colatitude, from 1 to -1."""
    kinds, n, _ = tables.shape
    found = np.zeros((kinds, CAPS))
    for c in range(CAPS):
        # the rows on both sides of whatever has such a cosine, and one more for what rounding does
        first = math.floor(math.acos(1 - 2 * c / CAPS) / math.pi * n - 0.5) - 1
        last = math.floor(math.acos(1 - 2 * (c + 1) / CAPS) / math.pi * n - 0.5) + 2
        for k in range(kinds):
            for i in range(max(first, 0), min(last, n - 1) + 1):
                found[k, c] = max(found[k, c], tables[k, i].max())
    return found


@njit(cache=True, error_model="numpy")
def are_apart(at: Floats, i: int, j: int, gap: float) -> bool:
    """Return whether two centres are that far from each other."""
    x, y, z = at[i, 0] - at[j, 0], at[i, 1] - at[j, 1], at[i, 2] - at[j, 2]
    return bool(x * x + y * y + z * z >= gap * gap)


@njit(cache=True, error_model="numpy")
def pairs_of(at: Floats, reach: Floats, skin: float) -> Ints:
    """Return the pairs (p, 2), second before first, whose balls are less than `skin` from each other, by number."""
    n, count = len(at), 0
    found = np.empty((16 * n + 16, 2), np.int64)
    for i in range(n):
        for j in range(i):
            if not are_apart(at, i, j, reach[i] + reach[j] + skin):
                if count == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[count, 0], found[count, 1] = i, j
                count += 1
    return found[:count]


@njit(cache=True, error_model="numpy")
def _turned(q: Floats, p: Floats) -> float:
    """Return a bound on the angle between two unit quaternions that are close."""
    one, other = 0.0, 0.0
    for k in range(4):
        one += (q[k] - p[k]) ** 2
        other += (q[k] + p[k]) ** 2
    return 2.1 * math.sqrt(min(one, other))


@njit(cache=True, error_model="numpy")
def moved(at: Floats, turn: Floats, i: int, j: int, reach: tuple[float, float], pose: Floats) -> float:
    """Return how far, at most, a point near body j has moved with body i (j = -1: with all that stands) since `pose`:
    the offset of both (3) and their turns (8).
    """
    square = 0.0
    for k in range(3):
        square += (at[i, k] - (at[j, k] if j >= 0 else 0.0) - pose[k]) ** 2
    found = math.sqrt(square) + reach[0] * _turned(turn[i], pose[3:7])
    return found + reach[1] * _turned(turn[j], pose[7:]) if j >= 0 else found


@njit(cache=True, error_model="numpy")
def note(at: Floats, turn: Floats, i: int, j: int, pose: Floats) -> None:
    """Fill the `pose` of two bodies to each other."""
    pose[:3] = at[i]
    pose[3:7] = turn[i]
    if j >= 0:
        pose[:3] -= at[j]
        pose[7:] = turn[j]


@njit(cache=True, error_model="numpy")
def _insert(near: Ints, depths: Floats, listed: int, k: int, depth: float) -> int:
    """List a point by its depth, the deepest first, as far as there is room; return how many should be listed."""
    if listed < len(near):
        n = listed
        while n > 0 and depths[n - 1] < depth:
            near[n], depths[n] = near[n - 1], depths[n - 1]
            n -= 1
        near[n], depths[n] = k, depth
    return listed + 1


@njit(cache=True, error_model="numpy")
def deepest_in(
    at: Floats, turn: Floats, i: int, j: int, points: Floats, table: Floats, cap: Floats, scale: tuple[float, float],
    near: Ints, depths: Floats, known: int, slack: float, point: Floats,
) -> tuple[float, int]:  # fmt: skip
    """Find the point of body i that is deepest in body j; return the depth, and how many points are `near`.

    known: so many points of `near` are tried, as long as their `depths` may have grown by `slack` to the deepest; -1:
    all are, and those listed that are less than `slack` from within, the deepest first. Of more than `near` holds the
    number is -1.
    """
    deepest, listed = 0.0, 0
    room = slack if known < 0 else 0.0
    moved, local = point, np.empty(3)
    # most points are out of reach: told in the body's own frame, where they need no turning
    for c in range(3):
        local[c] = at[i, c] - at[j, c]
    x, y, z = rotate(turn[i], local, True)
    local[0], local[1], local[2] = 0.0, 1.0, 0.0
    local[0], local[1], local[2] = rotate(turn[j], local, False)
    p, q, s = rotate(turn[i], local, True)
    fine, best = 0.5 * len(cap), -1
    for n in range(len(points) if known < 0 else known):
        if known >= 0 and depths[n] + slack < deepest:
            break
        k = n if known < 0 else near[n]
        u, v, w = points[k, 0] * scale[0] + x, points[k, 1] * scale[0] + y, points[k, 2] * scale[0] + z
        square = u * u + v * v + w * w
        if square < 1e-18:
            continue
        r = math.sqrt(square)
        if r >= cap[min(max(int((1 - (u * p + v * q + w * s) / r) * fine), 0), len(cap) - 1)] * scale[1] + room:
            continue
        moved[0], moved[1], moved[2] = u, v, w
        moved[0], moved[1], moved[2] = rotate(turn[i], moved, False)
        local[0], local[1], local[2] = rotate(turn[j], moved, True)
        depth = radius_at(table, local[0], local[1], local[2], r) * scale[1] - r
        if known < 0 and depth > -slack:
            listed = _insert(near, depths, listed, k, depth)
        if depth > deepest or (depth == deepest and k < best):
            deepest, best = depth, k
    if best >= 0:
        for c in range(3):
            moved[c] = points[best, c] * scale[0]
        moved[0] += x
        moved[1] += y
        moved[2] += z
        point[0], point[1], point[2] = rotate(turn[i], moved, False)
        for c in range(3):
            point[c] += at[j, c]
    return deepest, listed if listed <= len(near) else -1


@njit(cache=True, error_model="numpy")
def outwards(
    at: Floats, turn: Floats, j: int, table: Floats, size: float, deepest: float, point: Floats, normal: Floats
) -> float:
    """Fill the normal at a point within body j, and return the depth along it.

    Against the slope of the radius, by differences of the signed distance along the radius.
    """
    moved, local = np.empty(3), np.empty(3)
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
        high = up - radius_at(table, local[0], local[1], local[2], up) * size
        local[c] = kept - h
        up = math.sqrt(local[0] ** 2 + local[1] ** 2 + local[2] ** 2)
        slope[c] = high - up + radius_at(table, local[0], local[1], local[2], up) * size
        local[c] = kept
    slope /= math.sqrt(slope[0] ** 2 + slope[1] ** 2 + slope[2] ** 2) + 1e-12
    normal[0], normal[1], normal[2] = rotate(turn[j], slope, False)
    # the depth was along the radius
    lean = (normal[0] * moved[0] + normal[1] * moved[1] + normal[2] * moved[2]) / r
    return float(deepest * max(lean, 0.2))


@njit(cache=True, error_model="numpy")
def deepest_in_ground(
    at: Floats, turn: Floats, i: int, points: Floats, scale: float, reach: float, bowl: Floats, point: Floats,
    normal: Floats, near: Ints, depths: Floats, known: int, slack: float,
) -> tuple[float, int]:  # fmt: skip
    """Find the point of body i that is deepest in the floor y = 0 or in the bowl's shell; `near` as in `deepest_in`.

    bowl: radius of the inner sphere, thickness, height of the rim; radius 0 is no bowl. The inner sphere's lowest point
    lies `thickness` above the floor.
    """
    deepest, listed = 0.0, 0
    cy = at[i, 1] - bowl[0] - bowl[1]
    away = math.sqrt(at[i, 0] ** 2 + cy * cy + at[i, 2] ** 2)
    # most bodies of a heap are far from both
    far = reach + slack if known < 0 else reach
    clear = bowl[0] <= 0 or at[i, 1] - far > bowl[2] or away + far < bowl[0]
    if at[i, 1] > far and clear:
        return 0.0, 0
    # which side it came from, the body's centre says
    within = away < bowl[0] + 0.5 * bowl[1]
    moved = np.empty(3)
    for n in range(len(points) if known < 0 else known):
        if known >= 0 and depths[n] + slack < deepest:
            break
        k = n if known < 0 else near[n]
        moved[0], moved[1], moved[2] = rotate(turn[i], points[k], False)
        for c in range(3):
            moved[c] = moved[c] * scale + at[i, c]
        closest = -moved[1]
        if -moved[1] > deepest:
            deepest = -moved[1]
            point[:] = moved
            normal[0], normal[1], normal[2] = 0.0, 1.0, 0.0
        if bowl[0] > 0 and moved[1] <= bowl[2] + slack:
            y = moved[1] - bowl[0] - bowl[1]
            r = math.sqrt(moved[0] ** 2 + y * y + moved[2] ** 2)
            depth = r - bowl[0] if within else bowl[0] + bowl[1] - r
            closest = max(closest, depth)
            if depth > deepest and moved[1] <= bowl[2]:
                deepest = depth
                point[:] = moved
                side = -1.0 if within else 1.0
                normal[0], normal[1], normal[2] = side * moved[0] / r, side * y / r, side * moved[2] / r
        if known < 0 and closest > -slack:
            listed = _insert(near, depths, listed, k, closest)
    # within the shell a body changes sides sooner than what is near it shows
    changes = bowl[0] > 0 and abs(away - bowl[0] - 0.5 * bowl[1]) < slack
    return deepest, listed if listed <= len(near) and not changes else -1
