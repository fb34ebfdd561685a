"""Put a closed surface out of contact with itself, where it crosses and nowhere else, from nothing on.

What crosses, or nearly does, is evened out: its corners, and theirs, move towards the mean of their neighbours, as
far as they overlap and some gap more. So what moves grows from nothing as a gap closes. But how many rounds that takes,
and which pairs are watched between two looks at the whole, changes at once: where much folds some points jump as the
surface given moves (record dehydration-jumps).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .crossings import cross
from .inward import candidates, pairs

__all__ = ["GAP", "ROUNDS", "Apart", "Looked", "Topology", "look", "look_again", "put_apart"]

Doubles = NDArray[np.float64]
Words = NDArray[np.int32]

#: Gap, as a share of the smaller triangle's size (the least of its heights), at which evening out begins. By the
#: root of its area, needles around a pole would come near to those beside them.
GAP = 0.01
#: Share of it that is enough, in the first rounds and when they were not.
_ENOUGH, _AT_LAST = 0.5, 0.02
#: Way of a corner in each round, in overlaps with the gap added; twice as far after each look at the whole surface, for
#: slivers overlap by next to nothing however far they have to go.
_WAY = 2.0
#: Most rounds, and rounds between two looks at the whole surface.
ROUNDS, _STEPS = 240, 12
#: Axes that are tried for two triangles.
_AXES = 12
#: How many points beyond what is pushed others are watched until the next look.
_RINGS = 3


class Topology(NamedTuple):
    """Triangles (nt, 3), counter-clockwise from outside, and the neighbours of each vertex: those of vertex v are
    near[first[v] : first[v + 1]].
    """

    triangles: Words
    first: Words
    near: Words

    @classmethod
    def of(cls, triangles: NDArray[np.integer], vertices: int, links: NDArray[np.integer] | None = None) -> Topology:
        """Return the topology of closed triangles on so many vertices; `links` (m, 2) are more neighbours, each of the
        second vertex for the first one.
        """
        faces = np.ascontiguousarray(triangles, np.int32)
        # on a closed surface every neighbour is the next corner of exactly one triangle
        ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        if links is not None:
            ends = np.concatenate([ends, links.astype(np.int32)])
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        first = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=vertices))])
        return cls(faces, first.astype(np.int32), np.ascontiguousarray(ends[:, 1]))


class Apart(NamedTuple):
    """What was done: pairs that crossed or nearly did at first, rounds, and the pairs that still cross."""

    near: int
    rounds: int
    crossings: int


class Looked(NamedTuple):
    """What a look at a surface found: pairs (np, 2) of triangles that may touch, and the sizes (nt,) of these."""

    pairs: Words
    size: Doubles


def look(x: Doubles, topology: Topology) -> Looked:
    """Look at all of a surface of vertices x (nv, 3): most of what putting it apart takes."""
    size = np.empty(len(topology.triangles))
    return Looked(_look(x, topology.triangles, np.empty(0, np.bool_), size), size)


def look_again(x: Doubles, topology: Topology, before: Looked, moved: NDArray[np.bool_]) -> Looked:
    """Look at a surface some vertices of which, `moved` (nv,), lie elsewhere than at the last look."""
    is_moved = np.asarray(moved[topology.triangles].any(axis=1))
    stay, size = before.pairs[~is_moved[before.pairs].any(axis=1)], before.size.copy()
    return Looked(np.concatenate([stay, _look(x, topology.triangles, moved, size)]), size)


def put_apart(
    x: Doubles, topology: Topology, rounds: int = ROUNDS, looked: Looked | None = None, least: float = 0.0
) -> Apart:
    """Even out, in place, where the surface of vertices x (nv, 3) crosses itself; with no rounds, only count.

    `looked`: what a look at these very vertices found. What is counted are pairs of triangles without a common corner
    that cross after rounding to single precision. `least`: gap that stays between any two, twice of which is asked for:
    of needles around a pole, a share of their size is less than rounding takes.
    """
    return Apart(*_put_apart(x, *topology, rounds, *(looked or look(x, topology)), least))


@njit(cache=True, error_model="numpy", nogil=True)  # a service has others to answer meanwhile
def _look(x: Doubles, faces: Words, moved: NDArray[np.bool_], size: Doubles) -> Words:
    some = candidates(x, faces, moved)
    return pairs(x, faces, some, size, moved) if len(some) > 0 else np.empty((0, 2), np.int32)


@njit(cache=True, error_model="numpy", nogil=True)
def _put_apart(
    x: Doubles, faces: Words, first: Words, near: Words, rounds: int, found: Words, sizes: Doubles, least: float
) -> tuple[int, int, int]:
    began, spent = -1, 0
    size, weight, way, gone = sizes.copy(), np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x))
    moved = np.empty(0, np.bool_)
    while True:
        if len(moved) > 0:
            # what did not move since the last look was out of contact then
            some = candidates(x, faces, moved)
            if len(some) == 0:
                return max(began, 0), spent, 0
            found = pairs(x, faces, some, size, moved)
        axes, until = np.zeros(len(found), np.int8), np.zeros(len(found))
        active, pushed = _weigh(x, faces, found, axes, until, gone, size, weight, spent, least)
        began = active if began < 0 else began
        if active == 0:
            return began, spent, 0
        if spent >= rounds:
            if len(moved) > 0:
                found = pairs(x, faces, candidates(x, faces, moved[:0]), size, moved[:0])
            return began, spent, _count(x, faces, found)
        moved = np.zeros(len(x), np.bool_)
        kept = _around(faces, found, pushed, first, near)
        few, few_axes, few_until = found[kept], axes[kept], until[kept]
        last = min(spent + _STEPS, rounds)
        while active > 0 and spent < last:
            _step(x, _spread(weight, pushed, way, first, near), way, gone, moved, first, near)
            spent += 1
            weight[pushed] = 0
            active, pushed = _weigh(x, faces, few, few_axes, few_until, gone, size, weight, spent, least)
        weight[pushed] = 0


@njit(cache=True, error_model="numpy")
def _around(faces: Words, found: Words, pushed: Words, first: Words, near: Words) -> NDArray[np.int64]:
    """Return which pairs some rounds may bring into contact: those a few points from what is pushed."""
    is_near = np.zeros(len(first) - 1, np.bool_)
    front = pushed
    for _ in range(_RINGS):
        count = 0
        wider = np.empty(len(front) * 8, np.int32)
        for v in front:
            is_near[v] = True
            for place in range(first[v], first[v + 1]):
                w = near[place]
                if not is_near[w]:
                    is_near[w] = True
                    if count == len(wider):
                        wider = np.concatenate((wider, wider))
                    wider[count] = w
                    count += 1
        front = wider[:count]
    kept = np.empty(len(found), np.int64)
    count = 0
    for n in range(len(found)):
        a, b = found[n, 0], found[n, 1]
        for k in range(3):
            if is_near[faces[a, k]] or is_near[faces[b, k]]:
                kept[count] = n
                count += 1
                break
    return kept[:count]


@njit(cache=True, error_model="numpy")
def _along(x: Doubles, faces: Words, a: int, b: int, axis: int) -> float:
    """By how much two triangles overlap along one of the axes that can tell them apart; less than 0: a gap.

    The normals of both, one of which tells most pairs apart, from one's middle to the other's, then the products of an
    edge of each. Infinite where the axis has no length.
    """
    if axis == 2:
        nx = ny = nz = 0.0
        for k in range(3):
            v, w = faces[a, k], faces[b, k]
            nx, ny, nz = nx + x[w, 0] - x[v, 0], ny + x[w, 1] - x[v, 1], nz + x[w, 2] - x[v, 2]
        return _apart_by(x, faces, a, b, nx, ny, nz, nx * nx + ny * ny + nz * nz)
    if axis < 2:
        t = a if axis == 0 else b
        p, q, r = faces[t, 0], faces[t, 1], faces[t, 2]
        s, u = p, r
    else:
        i, j = (axis - 3) // 3, (axis - 3) % 3
        p, q = faces[a, i], faces[a, (i + 1) % 3]
        s, u = faces[b, j], faces[b, (j + 1) % 3]
    ux, uy, uz = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
    vx, vy, vz = x[u, 0] - x[s, 0], x[u, 1] - x[s, 1], x[u, 2] - x[s, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if square <= 1e-8 * (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz):
        return math.inf
    return _apart_by(x, faces, a, b, nx, ny, nz, square)


@njit(cache=True, error_model="numpy")
def _apart_by(x: Doubles, faces: Words, a: int, b: int, nx: float, ny: float, nz: float, square: float) -> float:
    """By how much two triangles overlap along an axis of this squared length."""
    if square <= 0:
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
    x: Doubles,
    faces: Words,
    pairs: Words,
    axes: NDArray[np.int8],
    until: Doubles,
    gone: Doubles,
    size: Doubles,
    weight: Doubles,
    spent: int,
    least: float,
) -> tuple[int, Words]:
    """Fill the way (nv,), zero before, that each vertex may go after so many rounds; return the number of pairs that
    ask for it, 0 if enough of the gap stays everywhere, and the vertices that have one.

    A pair found apart is not asked again `until` (np,) its corners have `gone` (nv,) as far as it was, together.
    """
    enough = _ENOUGH if spent < _STEPS else _AT_LAST
    far = _WAY * 2.0 ** min(spent // _STEPS, 8)
    active, is_enough = 0, True
    pushed, count = np.empty(1024, np.int32), 0
    for n in range(len(pairs)):
        a, b = pairs[n, 0], pairs[n, 1]
        way = 0.0
        for k in range(3):
            way += gone[faces[a, k]] + gone[faces[b, k]]
        if way < until[n]:
            continue
        gap = max(GAP * min(size[a], size[b]), 2 * least)
        # what told them apart last does so again, mostly
        overlap = _along(x, faces, a, b, axes[n])
        last = axes[n]
        for axis in range(_AXES):
            if overlap <= -gap:
                break
            if axis != last:
                here = _along(x, faces, a, b, axis)
                if here < overlap:
                    overlap, axes[n] = here, axis
        if overlap <= -gap:
            until[n] = way - gap - overlap
            continue
        active += 1
        way = far * (overlap + gap)
        is_enough = is_enough and overlap <= -max(enough * gap, least)
        if count + 6 > len(pushed):
            pushed = np.concatenate((pushed, pushed))
        for t in (a, b):
            for k in range(3):
                v = faces[t, k]
                if weight[v] == 0:
                    pushed[count] = v
                    count += 1
                weight[v] = max(weight[v], way)
    return 0 if is_enough else active, pushed[:count]


@njit(cache=True, error_model="numpy")
def _spread(weight: Doubles, pushed: Words, way: Doubles, first: Words, near: Words) -> Words:
    """Give vertices the longest way among their own and their neighbours', zero before; return those that have one."""
    who, count = np.empty(len(pushed) * 8, np.int32), 0
    for v in pushed:
        if count + 1 + first[v + 1] - first[v] > len(who):
            who = np.concatenate((who, np.empty(len(who) + first[v + 1] - first[v] + 1, np.int32)))
        if way[v] == 0:
            who[count] = v
            count += 1
        way[v] = max(way[v], weight[v])
        for place in range(first[v], first[v + 1]):
            w = near[place]
            if way[w] == 0:
                who[count] = w
                count += 1
            way[w] = max(way[w], weight[v])
    return who[:count]


@njit(cache=True, error_model="numpy")
def _step(
    x: Doubles, who: Words, way: Doubles, gone: Doubles, moved: NDArray[np.bool_], first: Words, near: Words
) -> None:
    """Move some vertices halfway to the mean of their neighbours, but no farther than their way, which is then zero;
    add to what each has `gone`.
    """
    goal = np.empty((len(who), 3))
    for n in range(len(who)):
        v = who[n]
        square = 0.0
        for k in range(3):
            total = 0.0
            for place in range(first[v], first[v + 1]):
                total += x[near[place], k]
            goal[n, k] = (total / (first[v + 1] - first[v]) - x[v, k]) / 2
            square += goal[n, k] ** 2
        part = min(way[v] / math.sqrt(square), 1.0) if square > 0 else 0.0
        gone[v] += part * math.sqrt(square)
        for k in range(3):
            goal[n, k] = x[v, k] + part * goal[n, k]
    for n in range(len(who)):
        v = who[n]
        moved[v], way[v] = True, 0.0
        for k in range(3):
            x[v, k] = goal[n, k]


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
