"""Plane triangulations held to an outline: borders as chains, edges flipped in, and what is still open filled."""

from __future__ import annotations

import numpy as np

from ..arrays import Array

__all__ = ["bordered", "filled", "flipped"]

_Edge = tuple[int, int]


def bordered(triangles: Array) -> Array:
    """Return the directed edges (e, 2) of triangles (f, 3) that no other triangle has the other way round."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return _chain(edges)


def _chain(edges: Array) -> Array:
    """Return what is left of directed edges (e, 2) where those there and back cancel, sorted."""
    if not len(edges):
        return np.zeros((0, 2), np.int64)
    count = int(edges.max()) + 1
    low, high = edges.min(axis=1), edges.max(axis=1)
    keys, number = np.unique(low * count + high, return_inverse=True)
    net = np.zeros(len(keys), np.int64)
    np.add.at(net, number, np.where(edges[:, 0] < edges[:, 1], 1, -1))
    ends = np.stack([keys // count, keys % count], -1)
    ends = np.where((net < 0)[:, None], ends[:, ::-1], ends)
    return np.repeat(ends, np.abs(net), axis=0)


def flipped(points: Array, triangles: Array, rim: Array) -> Array:
    """Return a triangulation (f, 3) of points (k, 2), wound to the left, that has the edges `rim` (e, 2) too.

    Edges that cross a missing one are flipped until none does (Sloan 1993). One that passes through a point, or
    crosses another of the rim, stays missing.
    """
    count = len(points)
    ways = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = np.concatenate([ways @ [count, 1], ways @ [1, count]])
    missing = rim[~np.isin(rim @ np.array([count, 1]), there)]
    if not len(missing):
        return triangles
    tips: dict[_Edge, int] = {}
    for a, b, c in triangles.tolist():
        tips[a, b], tips[b, c], tips[c, a] = c, a, b
    held = {edge for u, v in rim.tolist() for edge in ((u, v), (v, u))}
    at: list[tuple[float, float]] = [(x, y) for x, y in points.tolist()]
    for u, v in missing.tolist():
        _through(at, tips, held, u, v)
    found = {min((a, b, c), (b, c, a), (c, a, b)) for (a, b), c in tips.items()}
    return np.array(sorted(found), np.int64).reshape(-1, 3)


def _turn(at: list[tuple[float, float]], a: int, b: int, c: int) -> float:
    (ax, ay), (bx, by), (cx, cy) = at[a], at[b], at[c]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _through(at: list[tuple[float, float]], tips: dict[_Edge, int], held: set[_Edge], u: int, v: int) -> None:
    """Flip edges until u to v is one of them; leave them as they are at what cannot be passed."""

    def crosses(a: int, b: int) -> bool:
        if {a, b} & {u, v}:
            return False
        return _turn(at, u, v, a) * _turn(at, u, v, b) < 0 and _turn(at, a, b, u) * _turn(at, a, b, v) < 0

    queue = [(a, b) for a, b in tips if a < b and crosses(a, b)]
    patience = 20 * len(queue) ** 2 + 20
    while queue and patience:
        patience -= 1
        a, b = queue.pop(0)
        if (a, b) in held or (b, a) not in tips or (a, b) not in tips:
            return
        c, d = tips[a, b], tips[b, a]
        if _turn(at, c, d, b) <= 0 or _turn(at, d, c, a) <= 0:
            queue.append((a, b))  # not convex: others first
            continue
        del tips[a, b], tips[b, a]
        tips[c, d], tips[d, b], tips[b, c] = b, c, d
        tips[d, c], tips[c, a], tips[a, d] = a, d, c
        if crosses(c, d):
            queue.append((min(c, d), max(c, d)))


def filled(points: Array, triangles: Array, rim: Array) -> Array:
    """Return triangles (f, 3) with more, so that their border is `rim` (e, 2): holes are closed by cutting off ears.

    What is missing after the edges above are points that lie on an edge, to rounding: such holes have no width.
    """
    missing = _chain(np.concatenate([rim, bordered(triangles)[:, ::-1]]))
    more = [ear for loop in _loops(missing) for ear in _ears(points, loop)]
    return np.concatenate([triangles, np.array(more, np.int64).reshape(-1, 3)])


def _loops(edges: Array) -> list[list[int]]:
    """Return the loops of directed edges (e, 2), as many to each point as from it; none passes a point twice."""
    onward: dict[int, list[int]] = {}
    for u, v in edges.tolist():
        onward.setdefault(u, []).append(v)
    loops = []
    for start in sorted(onward):
        while onward.get(start):
            way = [start]
            while onward.get(way[-1]):
                new = onward[way[-1]].pop()
                if new in way:
                    k = way.index(new)
                    loops.append(way[k:])
                    way = way[: k + 1]
                else:
                    way.append(new)
    return loops


def _ears(points: Array, loop: list[int]) -> list[tuple[int, int, int]]:
    """Return the triangles of a loop, the widest corner cut off first."""
    left, found = list(loop), []
    while len(left) > 2:
        xy = points[left]
        to, fro = np.roll(xy, -1, axis=0) - xy, np.roll(xy, 1, axis=0) - xy
        turn = to[:, 0] * fro[:, 1] - to[:, 1] * fro[:, 0]
        k = int(np.argmax(turn))
        found.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return found
