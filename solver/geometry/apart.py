"""Put a closed surface out of contact with itself, where it crosses and nowhere else, without a jump.

A surface around the origin whose triangles all face away from it is seen whole from there: it covers every direction
once and crosses nowhere. Where it covers a direction more than once, one of those triangles faces the origin, for their
signs add up to one. So two triangles that cross lie before or behind one that faces inwards: those few are looked for
first, and where there is none that is all. Surfaces that do not enclose the origin, or enclose it twice, are not meant.

What then crosses, or nearly does, is evened out: its corners, and theirs, move towards the mean of their neighbours, as
far as they overlap and some gap more. So what moves grows from nothing as a gap closes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .crossings import cross

__all__ = ["GAP", "Apart", "Topology", "put_apart"]

Doubles = NDArray[np.float64]
Words = NDArray[np.int32]

#: Gap, as a share of the smaller triangle's size (root of its area), at which evening out begins.
GAP = 0.01
#: Share of it that is enough, in the first rounds and when they were not.
_ENOUGH, _AT_LAST = 0.5, 0.02
#: Way of a corner in each round, in overlaps with the gap added.
_WAY = 2.0
#: How far around a pair is looked for at the beginning of each few rounds, likewise, and how many rounds there are, and
#: in each.
_AROUND, _ROUNDS, _STEPS = 0.1, 60, 12
#: Cosine between a triangle's normal and the direction to it below which it counts as facing inwards.
_STEEP = 0.03
#: Sides of the cube around the origin reach to this, so that triangles over an edge are whole on one; and their cells.
_WIDE, _CELLS = 1.3, 96


class Topology(NamedTuple):
    """Triangles (nt, 3), counter-clockwise from outside, and the neighbours of each vertex: those of vertex v are
    near[first[v] : first[v + 1]].
    """

    triangles: Words
    first: Words
    near: Words

    @classmethod
    def of(cls, triangles: NDArray[np.integer], vertices: int) -> Topology:
        """Return the topology of closed triangles on so many vertices."""
        faces = np.ascontiguousarray(triangles, np.int32)
        # on a closed surface every neighbour is the next corner of exactly one triangle
        ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        first = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=vertices))])
        return cls(faces, first.astype(np.int32), np.ascontiguousarray(ends[:, 1]))


class Apart(NamedTuple):
    """What was done: pairs that crossed or nearly did at first, rounds, and the pairs that still cross."""

    near: int
    rounds: int
    crossings: int


def put_apart(x: Doubles, topology: Topology, rounds: int = _ROUNDS) -> Apart:
    """Even out, in place, where the surface of vertices x (nv, 3) crosses itself; with no rounds, only count.

    What is counted are pairs of triangles without a common corner that cross after rounding to single precision.
    """
    return Apart(*_put_apart(x, *topology, rounds))


@njit(cache=True, error_model="numpy")
def _put_apart(x: Doubles, faces: Words, first: Words, near: Words, rounds: int) -> tuple[int, int, int]:
    began, spent = -1, 0
    size, weight, way = np.empty(len(faces)), np.empty(0), np.empty(0)
    while True:
        some = _candidates(x, faces, size)
        if len(some) == 0:
            return max(began, 0), spent, 0
        if began < 0:
            weight, way = np.empty(len(x)), np.empty(len(x))
        found = _pairs(x, faces, some, size)
        axes = np.zeros(len(found), np.int8)
        active = _weigh(x, faces, found, axes, size, weight, _ENOUGH if spent < _STEPS else _AT_LAST)
        began = active if began < 0 else began
        if active == 0 or spent >= rounds:
            return began, spent, _count(x, faces, found) if active else 0
        last = min(spent + _STEPS, rounds)
        while active > 0 and spent < last:
            _spread(weight, way, first, near)
            _step(x, way, first, near)
            spent += 1
            active = _weigh(x, faces, found, axes, size, weight, _ENOUGH if spent < _STEPS else _AT_LAST)


@njit(cache=True, error_model="numpy")
def _look(x: Doubles, faces: Words, t: int, size: Doubles) -> bool:
    """Note a triangle's size, and return whether it faces the origin, or hardly away from it."""
    a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    volume = nx * x[a, 0] + ny * x[a, 1] + nz * x[a, 2]
    square = nx * nx + ny * ny + nz * nz
    size[t] = math.sqrt(math.sqrt(square) / 2)
    if volume <= 0:
        return True
    square *= x[a, 0] ** 2 + x[a, 1] ** 2 + x[a, 2] ** 2
    return volume * volume <= _STEEP**2 * square


@njit(cache=True, error_model="numpy")
def _project(x: Doubles, faces: Words, t: int, side: int, box: NDArray[np.int64]) -> bool:
    """Fill `box` (2, 2) with the first and last cell that a triangle covers on a side of the cube around the origin, as
    seen from there; return False where it is not seen whole.
    """
    axis, sign = side // 2, 1 - 2 * (side % 2)
    low_u = low_v = math.inf
    high_u = high_v = -math.inf
    for i in range(3):
        v = faces[t, i]
        depth = sign * x[v, axis]
        if depth <= 1e-9:
            return False
        u, w = x[v, (axis + 1) % 3] / depth, x[v, (axis + 2) % 3] / depth
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, w), max(high_v, w)
    if low_u < -_WIDE or high_u > _WIDE or low_v < -_WIDE or high_v > _WIDE:
        return False
    # and the cells around, for what only comes near
    scale = _CELLS / (2 * _WIDE)
    box[0, 0] = max(int((low_u + _WIDE) * scale) - 1, 0)
    box[0, 1] = min(int((high_u + _WIDE) * scale) + 1, _CELLS - 1)
    box[1, 0] = max(int((low_v + _WIDE) * scale) - 1, 0)
    box[1, 1] = min(int((high_v + _WIDE) * scale) + 1, _CELLS - 1)
    return True


@njit(cache=True, error_model="numpy")
def _candidates(x: Doubles, faces: Words, size: Doubles) -> Words:
    """Return the triangles that lie before or behind one that faces inwards; `size` (nt,) is filled."""
    inward, count = np.empty(len(faces), np.int32), 0
    for t in range(len(faces)):
        if _look(x, faces, t, size):
            inward[count] = t
            count += 1
    if count == 0:
        return inward[:0]
    marked = np.zeros((6, _CELLS, _CELLS), np.bool_)
    box = np.empty((2, 2), np.int64)
    for n in range(count):
        seen = False
        for side in range(6):
            if _project(x, faces, inward[n], side, box):
                seen = True
                for i in range(box[0, 0], box[0, 1] + 1):
                    for j in range(box[1, 0], box[1, 1] + 1):
                        marked[side, i, j] = True
        if not seen:  # too large for any side: all are looked at
            return np.arange(len(faces)).astype(np.int32)
    # the cell of each vertex on its own side
    sides, rows, columns = np.empty(len(x), np.int8), np.empty(len(x), np.int16), np.empty(len(x), np.int16)
    scale = _CELLS / (2 * _WIDE)
    for v in range(len(x)):
        side = 0
        for k in range(1, 3):
            if abs(x[v, k]) > abs(x[v, side]):
                side = k
        depth = max(abs(x[v, side]), 1e-12)
        rows[v] = int((x[v, (side + 1) % 3] / depth + _WIDE) * scale)
        columns[v] = int((x[v, (side + 2) % 3] / depth + _WIDE) * scale)
        sides[v] = 2 * side + (x[v, side] < 0)
    some, count = np.empty(len(faces), np.int32), 0
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        side = sides[a]
        if sides[b] == side and sides[c] == side:
            box[0, 0], box[0, 1] = min(rows[a], rows[b], rows[c]), max(rows[a], rows[b], rows[c])
            box[1, 0], box[1, 1] = min(columns[a], columns[b], columns[c]), max(columns[a], columns[b], columns[c])
            is_one = False
        else:
            is_one = not _project(x, faces, t, side, box)
        for i in range(box[0, 0], box[0, 1] + 1):
            for j in range(box[1, 0], box[1, 1] + 1):
                is_one = is_one or marked[side, i, j]
        if is_one:
            some[count] = t
            count += 1
    return some[:count]


@njit(cache=True, error_model="numpy")
def _pairs(x: Doubles, faces: Words, some: Words, size: Doubles) -> Words:
    """Return the pairs (np, 2) among some triangles without a common corner whose boxes touch or nearly do."""
    count = len(some)
    box = np.empty((count, 6), np.float32)
    for n in range(count):
        t = some[n]
        more = _AROUND * size[t] + 1e-6
        for k in range(3):
            a, b, c = x[faces[t, 0], k], x[faces[t, 1], k], x[faces[t, 2], k]
            box[n, k], box[n, 3 + k] = min(a, b, c) - more, max(a, b, c) + more
    # in strips across y, each swept along x
    first_y, last_y = box[:, 1].min(), box[:, 4].max()
    strips = min(max(int(math.sqrt(count)) // 4, 1), 64)
    scale = strips / max(last_y - first_y, 1e-6)
    order = np.argsort(box[:, 0])
    found, room = np.empty((1024, 2), np.int32), 0
    place, sorted_box = np.empty(count, np.int32), np.empty((count, 6), np.float32)
    for strip in range(strips):
        low, high = first_y + strip / scale, first_y + (strip + 1) / scale
        held = 0
        for m in range(count):
            n = order[m]
            if box[n, 1] <= high and box[n, 4] >= low:
                place[held] = n
                for k in range(6):
                    sorted_box[held, k] = box[n, k]
                held += 1
        for m in range(held):
            x1, y0, y1, z0, z1 = (
                sorted_box[m, 3],
                sorted_box[m, 1],
                sorted_box[m, 4],
                sorted_box[m, 2],
                sorted_box[m, 5],
            )
            for o in range(m + 1, held):
                if sorted_box[o, 0] > x1:
                    break
                if sorted_box[o, 1] > y1 or y0 > sorted_box[o, 4] or sorted_box[o, 2] > z1 or z0 > sorted_box[o, 5]:
                    continue
                # a pair belongs to the strip in which both are met first
                if strip > 0 and max(y0, sorted_box[o, 1]) < low:
                    continue
                if _neighbours(faces, some[place[m]], some[place[o]]):
                    continue
                if room == len(found):
                    found = np.concatenate((found, found))
                found[room, 0], found[room, 1] = some[place[m]], some[place[o]]
                room += 1
    return found[:room]


@njit(cache=True, error_model="numpy")
def _neighbours(faces: Words, a: int, b: int) -> bool:
    for i in range(3):
        for j in range(3):
            if faces[a, i] == faces[b, j]:
                return True
    return False


@njit(cache=True, error_model="numpy")
def _along(x: Doubles, faces: Words, a: int, b: int, axis: int) -> float:
    """By how much two triangles overlap along one of the eleven axes that can tell them apart; less than 0: a gap.

    The normals of both, then the products of an edge of each. Infinite where the axis has no length.
    """
    if axis < 2:
        t = a if axis == 0 else b
        p, q, r = faces[t, 0], faces[t, 1], faces[t, 2]
        s, u = p, r
    else:
        i, j = (axis - 2) // 3, (axis - 2) % 3
        p, q = faces[a, i], faces[a, (i + 1) % 3]
        s, u = faces[b, j], faces[b, (j + 1) % 3]
    ux, uy, uz = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
    vx, vy, vz = x[u, 0] - x[s, 0], x[u, 1] - x[s, 1], x[u, 2] - x[s, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if square <= 1e-8 * (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz):
        return math.inf
    low_a = low_b = math.inf
    high_a = high_b = -math.inf
    for k in range(3):
        v, w = faces[a, k], faces[b, k]
        y = nx * x[v, 0] + ny * x[v, 1] + nz * x[v, 2]
        z = nx * x[w, 0] + ny * x[w, 1] + nz * x[w, 2]
        low_a, high_a, low_b, high_b = min(low_a, y), max(high_a, y), min(low_b, z), max(high_b, z)
    return min(high_a - low_b, high_b - low_a) / math.sqrt(square)


@njit(cache=True, error_model="numpy")
def _weigh(
    x: Doubles, faces: Words, pairs: Words, axes: NDArray[np.int8], size: Doubles, weight: Doubles, enough: float
) -> int:
    """Fill the way (nv,) that each vertex may go, and return the number of pairs that ask for it; 0 if `enough` of
    the gap stays everywhere.
    """
    weight[:] = 0
    active, is_enough = 0, True
    for n in range(len(pairs)):
        a, b = pairs[n, 0], pairs[n, 1]
        gap = GAP * min(size[a], size[b])
        # what told them apart last does so again, mostly
        overlap = _along(x, faces, a, b, axes[n])
        if overlap <= -gap:
            continue
        for axis in range(11):
            here = _along(x, faces, a, b, axis)
            if here < overlap:
                overlap, axes[n] = here, axis
                if overlap <= -gap:
                    break
        if overlap <= -gap:
            continue
        active += 1
        way = _WAY * (overlap + gap)
        is_enough = is_enough and overlap <= -enough * gap
        for k in range(3):
            weight[faces[a, k]] = max(weight[faces[a, k]], way)
            weight[faces[b, k]] = max(weight[faces[b, k]], way)
    return 0 if is_enough else active


@njit(cache=True, error_model="numpy")
def _spread(weight: Doubles, way: Doubles, first: Words, near: Words) -> None:
    """Give every vertex the longest way among its own and its neighbours'."""
    way[:] = weight
    for v in range(len(weight)):
        if weight[v] > 0:
            for place in range(first[v], first[v + 1]):
                way[near[place]] = max(way[near[place]], weight[v])


@njit(cache=True, error_model="numpy")
def _step(x: Doubles, way: Doubles, first: Words, near: Words) -> None:
    """Move vertices halfway to the mean of their neighbours, but no farther than their way."""
    count = 0
    for v in range(len(x)):
        count += way[v] > 0
    goal, who, place = np.empty((count, 3)), np.empty(count, np.int32), 0
    for v in range(len(x)):
        if way[v] <= 0:
            continue
        square = 0.0
        for k in range(3):
            total = 0.0
            for n in range(first[v], first[v + 1]):
                total += x[near[n], k]
            goal[place, k] = (total / (first[v + 1] - first[v]) - x[v, k]) / 2
            square += goal[place, k] ** 2
        part = min(way[v] / math.sqrt(square), 1.0) if square > 0 else 0.0
        for k in range(3):
            goal[place, k] = x[v, k] + part * goal[place, k]
        who[place] = v
        place += 1
    for n in range(count):
        for k in range(3):
            x[who[n], k] = goal[n, k]


@njit(cache=True, error_model="numpy")
def _count(x: Doubles, faces: Words, pairs: Words) -> int:
    """Return how many pairs cross after rounding to single precision."""
    count = 0
    p, q = np.empty((3, 3)), np.empty((3, 3))
    for n in range(len(pairs)):
        for i in range(3):
            for k in range(3):
                p[i, k] = np.float64(np.float32(x[faces[pairs[n, 0], i], k]))
                q[i, k] = np.float64(np.float32(x[faces[pairs[n, 1], i], k]))
        count += cross(p, q)
    return count
