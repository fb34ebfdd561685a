"""Which stencils may come within reach: a grid over vertices, and what is near at rest where the sheet is not flat."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Bools, Floats, Ints
from ..topology import Topology
from .distance import EDGES, FACE, nearest
from .near import Near, flat

__all__ = ["Pairs", "search", "within"]

#: Share of their rest distance along the sheet within which two places feel each other.
_SHARE = 0.5
#: Edges on a way of the mean edge's length.
_APART = 1.3


class Pairs(NamedTuple):
    """Stencils (m, 4), their kinds (m,), reaches (m,), areas (m,), and how far beyond their reach they were found (m,).

    The first `near` of them are near each other along the sheet: theirs is over the edges in between. Both parts are
    sorted by it.
    """

    stencils: Ints
    kinds: Ints
    reach: Floats
    areas: Floats
    beyond: Floats
    near: int

    def within(self, change: float, move: float) -> tuple[int, int]:
        """Return how many of the near ones and of the rest may be in reach once edges and vertices moved so far."""
        parts = self.beyond[: self.near], self.beyond[self.near :]
        return int(np.searchsorted(parts[0], change)), int(np.searchsorted(parts[1], 2 * move))


def search(x: Floats, mesh: Topology, near: Near, distance: float, room: float, change: float, length: float) -> Pairs:
    """Return what may come within reach while no vertex moves by more than `room`.

    And, for what lies near each other along the sheet, while no edge's ends part by more than `change`: places that
    are k edges apart part by no more than k times that. length: of an edge.
    """
    even = flat(x, mesh.triangles, near.start, near.other)
    spans = _spans(x, near.edge_start, near.edges)
    reach = distance + 2 * room
    size = reach + 2 * float(spans.max())
    corner = x.min(axis=0)
    # a grid no finer than what fits into memory
    size = max(size, float(np.ptp(x, axis=0).max()) / 200)
    cells = np.floor((x - corner) / size).astype(np.int64)
    wide = cells.max(axis=0) + 3
    keys = ((cells[:, 0] + 1) * wide[1] + cells[:, 1] + 1) * wide[2] + cells[:, 2] + 1
    order = np.argsort(keys, kind="stable")
    begin = np.searchsorted(keys[order], np.arange(int(np.prod(wide)) + 1))
    places = _near_places(x, near.start, near.other, even, spans, near.way, distance, change / length)
    places = np.concatenate([places, _far_places(x, order, begin, keys, wide, near.start, near.other, spans, reach)])
    own = near.start, near.other, near.way, near.altitudes, near.areas, near.face_start, near.faces
    balls = *_balls(x, near.faces), *_balls(x, near.edges)
    stencils, kinds, felt, areas, beyond, close = _stencils(
        x, places, *own, near.edge_start, near.edges, *balls, spans, distance, reach, change / length
    )
    beyond = np.where(close, length * beyond, beyond)
    order = np.lexsort((beyond, ~close))
    return Pairs(stencils[order], kinds[order], felt[order], areas[order], beyond[order], int(close.sum()))


def within(x: Floats, pairs: Pairs, factor: float = 1.0) -> Ints:
    """Return which stencils are nearer than their reach times a factor."""
    return _within(x, pairs.stencils, pairs.kinds, factor * pairs.reach)


@njit(cache=True, error_model="numpy")
def _within(x: Floats, stencils: Ints, kinds: Ints, reach: Floats) -> Ints:
    found, count = np.empty(len(stencils), np.int64), 0
    w, gap = np.empty(4), np.empty(3)
    for k in range(len(stencils)):
        if nearest(x, stencils[k], kinds[k], w, gap) < reach[k] * reach[k]:
            found[count] = k
            count += 1
    return found[:count].copy()


@njit(cache=True, error_model="numpy")
def _spans(x: Floats, start: Ints, edges: Ints) -> Floats:
    """Return the longest edge at each vertex (n,): what it owns lies within."""
    found = np.zeros(len(start) - 1)
    for e in range(len(edges)):
        i, j = edges[e]
        length = np.sqrt((x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2 + (x[i, 2] - x[j, 2]) ** 2)
        found[i], found[j] = max(found[i], length), max(found[j], length)
    return found


@njit(cache=True, error_model="numpy")
def _near_places(
    x: Floats, start: Ints, other: Ints, even: Bools, spans: Floats, way: Floats, distance: float, change: float
) -> Ints:
    """Return pairs of vertices (m, 3: both, 1) near along the sheet, where it is not flat, that may own what meets."""
    found, count = np.empty((len(other), 3), np.int64), 0
    for v in range(len(x)):
        if even[v]:
            continue
        for at in range(start[v], start[v + 1]):
            u = other[at]
            room = distance + _APART * (way[at] + spans[u] + spans[v]) * change + spans[u] + spans[v]
            if _square(x, u, v) <= room * room:
                found[count, 0], found[count, 1], found[count, 2] = v, u, 1
                count += 1
    return found[:count].copy()


@njit(cache=True, error_model="numpy")
def _far_places(
    x: Floats, order: Ints, begin: Ints, keys: Ints, wide: Ints, start: Ints, other: Ints, spans: Floats, reach: float
) -> Ints:
    """Return pairs of vertices (m, 3: the lower, the higher, 0) far along the sheet that may own what meets."""
    found, count = np.empty((1024, 3), np.int64), 0
    mark = np.full(len(x), -1)
    for v in range(len(x)):
        for at in range(start[v], start[v + 1]):
            mark[other[at]] = v
        for k in range(27):
            cell = keys[v] + ((k // 9 - 1) * wide[1] + (k // 3) % 3 - 1) * wide[2] + k % 3 - 1
            for at in range(begin[cell], begin[cell + 1]):
                u = order[at]
                if u <= v or mark[u] == v:
                    continue
                room = reach + spans[u] + spans[v]
                if _square(x, u, v) <= room * room:
                    if count == len(found):
                        found = np.concatenate((found, found))
                    found[count, 0], found[count, 1], found[count, 2] = v, u, 0
                    count += 1
    return found[:count].copy()


@njit(cache=True, error_model="numpy")
def _square(x: Floats, u: int, v: int) -> float:
    found: float = (x[u, 0] - x[v, 0]) ** 2 + (x[u, 1] - x[v, 1]) ** 2 + (x[u, 2] - x[v, 2]) ** 2
    return found


@njit(cache=True, error_model="numpy")
def _stencils(
    x: Floats, places: Ints, start: Ints, other: Ints, way: Floats, altitudes: Floats, areas: Floats, face_start: Ints,
    faces: Ints, edge_start: Ints, edges: Ints, face_middles: Floats, face_radii: Floats, edge_middles: Floats,
    edge_radii: Floats, spans: Floats, distance: float, far: float, change: float,
) -> tuple[Ints, Ints, Floats, Floats, Floats, Bools]:  # fmt: skip
    """Return the stencils of what pairs of vertices own, as in `Pairs`, and which are near along the sheet."""
    room, count, last = 1024, 0, -1
    stencils, kinds, close = np.empty((room, 4), np.int64), np.empty(room, np.int64), np.empty(room, np.bool_)
    numbers = np.empty((3, room))
    q, w, gap = np.empty(4, np.int64), np.empty(4), np.empty(3)
    mark, ways = np.full(len(x), -1), np.zeros(len(x))
    for v, u, near in places:
        if near and v != last:
            for at in range(start[v], start[v + 1]):
                mark[other[at]], ways[other[at]] = v, way[at]
            last = v
        apart = _APART * (ways[u] + spans[u] + spans[v]) if near else 1.0
        furthest = distance + apart * change if near else far
        # 0: v and faces of u, 1: u and faces of v, 2: edges of both; near ones come both ways
        for kind in range(3):
            if near and (kind == 1 or (kind == 2 and u < v)):
                continue
            what, owner = (EDGES, u) if kind == 2 else (FACE, v if kind == 1 else u)
            q[0] = u if kind == 1 else v
            for a in range(edge_start[v + 1] - edge_start[v] if kind == 2 else 1):
                first, end, about, radius = face_start[owner], face_start[owner + 1], x[q[0]], furthest
                if kind == 2:
                    q[1] = edges[edge_start[v] + a, 1]
                    first, end = edge_start[u], edge_start[u + 1]
                    about, radius = edge_middles[edge_start[v] + a], furthest + edge_radii[edge_start[v] + a]
                for b in range(first, end):
                    # most are ruled out by the balls about them
                    if kind == 2:
                        if _apart(about, edge_middles[b], radius + edge_radii[b]):
                            continue
                    elif _apart(about, face_middles[b], radius + face_radii[b]):
                        continue
                    if kind == 2:
                        q[2], q[3] = edges[b]
                    else:
                        q[1], q[2], q[3] = faces[b]
                    if q[2] == q[0] or q[3] == q[0] or (q[2] == q[1] or q[3] == q[1] if kind == 2 else q[1] == q[0]):
                        continue
                    felt = min(distance, _SHARE * _rest(q, kind, v, mark, ways, altitudes, spans)) if near else distance
                    square = nearest(x, q, what, w, gap)
                    if square > (felt + apart * change if near else far) ** 2:
                        continue
                    if count == room:
                        room *= 2
                        stencils, kinds = _more(stencils, kinds)
                        numbers, close = np.concatenate((numbers, numbers), 1), np.concatenate((close, close))
                    stencils[count], kinds[count], close[count], numbers[0, count] = q, what, near == 1, felt
                    whole = areas[q[0]] + areas[q[1]] + areas[q[2]] + areas[q[3]]
                    numbers[1, count] = whole / 12 if kind == 2 else areas[q[0]]
                    # of near ones over the edges in between, each of which adds its change
                    numbers[2, count] = (np.sqrt(square) - felt) / (apart if near else 1.0)
                    count += 1
    numbers = numbers[:, :count]
    return stencils[:count], kinds[:count], numbers[0], numbers[1], numbers[2], close[:count]


@njit(cache=True, error_model="numpy")
def _balls(x: Floats, corners: Ints) -> tuple[Floats, Floats]:
    """Return the middles (m, 3) and radii (m,) of balls about what has these corners (m, k)."""
    middles, radii = np.zeros((len(corners), 3)), np.zeros(len(corners))
    for m in range(len(corners)):
        for v in corners[m]:
            for d in range(3):
                middles[m, d] += x[v, d] / corners.shape[1]
        for v in corners[m]:
            square = 0.0
            for d in range(3):
                square += (x[v, d] - middles[m, d]) ** 2
            radii[m] = max(radii[m], np.sqrt(square))
    return middles, radii


@njit(cache=True, error_model="numpy")
def _apart(a: Floats, b: Floats, distance: float) -> bool:
    found: bool = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2 > distance * distance * (1 + 1e-12)
    return found


@njit(cache=True)
def _more(stencils: Ints, kinds: Ints) -> tuple[Ints, Ints]:
    return np.concatenate((stencils, stencils)), np.concatenate((kinds, kinds))


@njit(cache=True, error_model="numpy")
def _rest(q: Ints, kind: int, v: int, mark: Ints, ways: Floats, altitudes: Floats, spans: Floats) -> float:
    """Return a distance that the stencil has at rest, or less: by ways along edges, and by altitudes next to it."""
    least = np.inf
    for k in range(1 if kind != 2 else 2, 4):
        if mark[q[k]] == v:
            least = min(least, ways[q[k]])
    if kind == 2:
        least -= spans[v]
    height = min(min(altitudes[q[0]], altitudes[q[1]]), min(altitudes[q[2]], altitudes[q[3]]))
    found: float = max(least, height)
    return found
