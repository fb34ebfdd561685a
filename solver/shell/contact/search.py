"""Which stencils may come within reach: a grid over vertices, and what is near at rest where the sheet is not flat."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numba import njit

from ...arrays import Bools, Floats, Ints
from ...linalg.abreast import both, two
from ..topology import Topology
from .distance import EDGES, FACE, nearest
from .near import Near, flat

__all__ = ["Pairs", "owners", "search", "within"]

#: Share of their rest distance along the sheet within which two places feel each other.
_SHARE = 0.5
#: Edges on a way of the mean edge's length.
_APART = 1.3
#: Pairs of vertices from which on two threads share what they own.
_MANY = 5_000


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


def search(
    x: Floats,
    mesh: Topology,
    near: Near,
    distance: float,
    room: float,
    change: float,
    length: float,
    only: Literal["near", "far"] | None = None,
) -> Pairs:
    """Return what may come within reach while no vertex moves by more than `room`.

    And, for what lies near each other along the sheet, while no edge's ends part by more than `change`: places that
    are k edges apart part by no more than k times that, nor by more than both can move. length: of an edge. only: what
    is near each other along the sheet, or what is far.
    """
    spans = _spans(x, near.edge_start, near.edges)
    balls = _owned(x, near.edge_start, near.edges)
    reach = distance + 2 * room
    places = np.empty((0, 3), np.int64)
    if only != "far":
        even = flat(x, mesh.triangles, near.start, near.other)
        places = _near_places(
            *balls, near.start, near.other, even, spans, near.way, distance, change / length, 2 * room
        )
    if only != "near":
        far = _far_places(*balls, *_cells(*balls, reach), near.start, near.other, reach)
        places = np.concatenate([places, far])
    faces = len(near.faces)
    # triangles and edges are gone through alike
    parts = np.concatenate([near.faces, near.edges[:, [0, 1, 1]]])
    of_faces, of_edges = _balls(x, near.faces), _balls(x, near.edges)
    middles, radii = np.concatenate([of_faces[0], of_edges[0]]), np.concatenate([of_faces[1], of_edges[1]])
    own = near.start, near.other, near.way, near.altitudes, near.face_start, faces + near.edge_start
    rest = *own, parts, middles, radii, *balls, spans, distance, reach, change / length
    if len(places) < _MANY or not two():
        stencils, kinds, felt, beyond, close = _stencils(x, places, *rest)
    else:  # one after the other as found: the same list
        middle = len(places) // 2
        halves = both(lambda: _stencils(x, places[:middle], *rest), lambda _: _stencils(x, places[middle:], *rest))
        columns = zip(*(half[:4] for half in halves), strict=True)
        stencils, kinds, felt, beyond = (np.concatenate(column) for column in columns)
        close = halves[0][4] + halves[1][4]
    beyond[:close] *= length
    # near ones come first
    order = np.concatenate([_ascending(beyond[:close]), close + _ascending(beyond[close:])])
    stencils, kinds = stencils[order], kinds[order]
    a, b, c, d = near.areas[stencils.T]
    return Pairs(stencils, kinds, felt[order], np.where(kinds == EDGES, (a + b + c + d) / 12, a), beyond[order], close)


def _cells(middles: Floats, radii: Floats, reach: float) -> tuple[Ints, Ints, Ints, Ints]:
    """Return balls by their cells of a grid: (order, begin), their cells (n,), and how many cells there are each way.

    What comes within reach is in the same cell or next to it.
    """
    # a grid no finer than what fits into memory
    size = max(reach + 2 * float(radii.max()), float(np.ptp(middles, axis=0).max()) / 200)
    cells = np.floor((middles - middles.min(axis=0)) / size).astype(np.int64)
    wide = cells.max(axis=0) + 3
    keys = ((cells[:, 0] + 1) * wide[1] + cells[:, 1] + 1) * wide[2] + cells[:, 2] + 1
    order = np.argsort(keys, kind="stable")
    return order, np.searchsorted(keys[order], np.arange(int(np.prod(wide)) + 1)), keys, wide


def _ascending(values: Floats) -> Ints:
    """Return the order in which values (m,) ascend, equal ones as they stand."""
    return np.argsort(values, kind="stable")


def owners(stencils: Ints, kinds: Ints) -> Ints:
    """Return the vertices (m, 2), the lower first, that own the two parts of stencils (m, 4)."""
    second = np.where(kinds == EDGES, stencils[:, 2], stencils[:, 1:].min(axis=1))
    return np.sort(np.stack([stencils[:, 0], second], -1), axis=1)


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
    middles: Floats, radii: Floats, start: Ints, other: Ints, even: Bools, spans: Floats, way: Floats,
    distance: float, change: float, most: float,
) -> Ints:  # fmt: skip
    """Return pairs of vertices (m, 3: both, 1) near along the sheet, where it is not flat, that may own what meets.

    middles (n, 3), radii (n,): of balls about what each owns. most: by which places part at most.
    """
    found, count = np.empty((len(other), 3), np.int64), 0
    for v in range(len(middles)):
        if even[v]:
            continue
        for at in range(start[v], start[v + 1]):
            u = other[at]
            parted = min(_APART * (way[at] + spans[u] + spans[v]) * change, most)
            room = distance + parted + radii[u] + radii[v]
            if not _apart(middles[v, 0], middles[v, 1], middles[v, 2], middles, u, room):
                found[count, 0], found[count, 1], found[count, 2] = v, u, 1
                count += 1
    return found[:count].copy()


@njit(cache=True, error_model="numpy")
def _far_places(
    middles: Floats, radii: Floats, order: Ints, begin: Ints, keys: Ints, wide: Ints, start: Ints, other: Ints,
    reach: float,
) -> Ints:  # fmt: skip
    """Return pairs of vertices (m, 3: the lower, the higher, 0) far along the sheet that may own what meets."""
    found, count = np.empty((1024, 3), np.int64), 0
    mark = np.full(len(middles), -1)
    for v in range(len(middles)):
        ox, oy, oz = middles[v, 0], middles[v, 1], middles[v, 2]
        for at in range(start[v], start[v + 1]):
            mark[other[at]] = v
        for k in range(27):
            cell = keys[v] + ((k // 9 - 1) * wide[1] + (k // 3) % 3 - 1) * wide[2] + k % 3 - 1
            for at in range(begin[cell], begin[cell + 1]):
                u = order[at]
                if u <= v or mark[u] == v or _apart(ox, oy, oz, middles, u, reach + radii[u] + radii[v]):
                    continue
                if count == len(found):
                    found = np.concatenate((found, found))
                found[count, 0], found[count, 1], found[count, 2] = v, u, 0
                count += 1
    return found[:count].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _stencils(
    x: Floats, places: Ints, start: Ints, other: Ints, way: Floats, altitudes: Floats, face_start: Ints,
    edge_start: Ints, parts: Ints, middles: Floats, radii: Floats, owned: Floats, sizes: Floats, spans: Floats,
    distance: float, far: float, change: float,
) -> tuple[Ints, Ints, Floats, Floats, int]:  # fmt: skip
    """Return stencils, kinds, reaches of what pairs of vertices own, how far beyond, and how many of them are near.

    parts (f + e, 3): corners of triangles, then those of edges, the higher twice; middles, radii: of balls about them.
    owned, sizes: those of balls about what each vertex owns.
    """
    room, count, close, last = 1024, 0, 0, -1
    stencils, kinds, numbers = np.empty((room, 4), np.int64), np.empty(room, np.int64), np.empty((2, room))
    q, w, gap = np.empty(4, np.int64), np.empty(4), np.empty(3)
    ways, lows = np.full(len(x), np.inf), _lowest(altitudes, parts)
    for place in range(len(places)):
        v, u, near = places[place, 0], places[place, 1], places[place, 2] == 1
        if near and v != last:
            _lay_out(ways, start, other, way, last, v)
            last = v
        apart = _APART * (ways[u] + spans[u] + spans[v]) if near else 1.0
        parted = min(apart * change, far - distance) if near else far - distance
        furthest = distance + parted
        # 0: v and faces of u, 1: u and faces of v, 2: edges of both; near ones come both ways
        for kind in range(3):
            if near and (kind == 1 or (kind == 2 and u < v)):
                continue
            what, begin, back = (EDGES, edge_start, spans[v]) if kind == 2 else (FACE, face_start, 0.0)
            point, owner = (u, v) if kind == 1 else (v, u)
            first, end = (edge_start[v], edge_start[v + 1]) if kind == 2 else (0, 1)
            for a in range(first, end):
                second, low, radius = point, altitudes[point], furthest
                ox, oy, oz = x[point, 0], x[point, 1], x[point, 2]
                if kind == 2:
                    second, low, radius = parts[a, 1], lows[a], furthest + radii[a]
                    ox, oy, oz = middles[a, 0], middles[a, 1], middles[a, 2]
                if _apart(ox, oy, oz, owned, owner, radius + sizes[owner]):
                    continue
                for b in range(begin[owner], begin[owner + 1]):
                    # most are ruled out by the balls about them
                    if _apart(ox, oy, oz, middles, b, radius + radii[b]):
                        continue
                    i, j, k = parts[b, 0], parts[b, 1], parts[b, 2]
                    if i in (point, second) or j in (point, second) or k in (point, second):
                        continue
                    rest = _rest(ways, i, j, k, back, min(low, lows[b]))
                    felt = min(distance, _SHARE * rest) if near else distance
                    limit = felt + parted
                    q[0], q[1], q[2], q[3] = point, second if kind == 2 else i, i if kind == 2 else j, k
                    square = nearest(x, q, what, w, gap)
                    if square > limit * limit:
                        continue
                    if count == room:
                        room *= 2
                        stencils, kinds = _more(stencils, kinds)
                        numbers = np.concatenate((numbers, numbers), 1)
                    stencils[count] = q
                    # of near ones over the edges in between, each of which adds its change
                    kinds[count], numbers[0, count], numbers[1, count] = what, felt, (np.sqrt(square) - felt) / apart
                    count, close = count + 1, close + near
    return stencils[:count], kinds[:count], numbers[0, :count], numbers[1, :count], close


@njit(cache=True, error_model="numpy")
def _lay_out(ways: Floats, start: Ints, other: Ints, way: Floats, last: int, v: int) -> None:
    """Write ways (n,) from vertex v, infinite to what is not near it, over those from the last, if that is not -1."""
    for at in range(start[max(last, 0)], start[last + 1]):
        ways[other[at]] = np.inf
    for at in range(start[v], start[v + 1]):
        ways[other[at]] = way[at]


@njit(cache=True, error_model="numpy")
def _rest(ways: Floats, i: int, j: int, k: int, back: float, height: float) -> float:
    """Return a distance to i, j, k at rest, or less: by ways along edges, less `back`, and by altitudes next to it."""
    found: float = max(min(min(ways[i], ways[j]), ways[k]) - back, height)
    return found


@njit(cache=True, error_model="numpy")
def _apart(ox: float, oy: float, oz: float, middles: Floats, m: int, distance: float) -> bool:
    dx, dy, dz = ox - middles[m, 0], oy - middles[m, 1], oz - middles[m, 2]
    found: bool = dx * dx + dy * dy + dz * dz > distance * distance * (1 + 1e-12)
    return found


@njit(cache=True, error_model="numpy")
def _owned(x: Floats, edge_start: Ints, edges: Ints) -> tuple[Floats, Floats]:
    """Return middles (n, 3) and radii (n,) of balls about what each vertex owns."""
    middles, radii = x.copy(), np.zeros(len(x))
    for v in range(len(x)):
        first, end = edge_start[v], edge_start[v + 1]
        for d in range(3):
            for e in range(first, end):
                middles[v, d] += x[edges[e, 1], d]
            middles[v, d] /= end - first + 1
        for e in range(first - 1, end):
            u, square = v if e < first else edges[e, 1], 0.0
            for d in range(3):
                square += (x[u, d] - middles[v, d]) ** 2
            radii[v] = max(radii[v], np.sqrt(square))
    return middles, radii


@njit(cache=True, error_model="numpy")
def _lowest(altitudes: Floats, parts: Ints) -> Floats:
    """Return the least of the altitudes (n,) at the corners of each of parts (m, 3)."""
    found = np.empty(len(parts))
    for m in range(len(parts)):
        found[m] = min(min(altitudes[parts[m, 0]], altitudes[parts[m, 1]]), altitudes[parts[m, 2]])
    return found


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


@njit(cache=True)
def _more(stencils: Ints, kinds: Ints) -> tuple[Ints, Ints]:
    return np.concatenate((stencils, stencils)), np.concatenate((kinds, kinds))
