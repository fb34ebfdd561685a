"""Closed triangle meshes cut by a plane: what is left, its rim, and an even net of triangles that closes it.

Vertices are below the plane, in it or beyond it. What is left is the triangles that are below with a corner at least,
and of those that cross the part that is; triangles that lie in the plane whole go, and the cut face takes their place.
The rim is then no list of crossings but what is missing: the edges whose other side nothing holds. So whatever the
plane passes through, vertices, edges or a flat, each edge of half and face together is there twice, once each way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import Delaunay, KDTree

from ..arrays import Array
from .outlined import bordered, filled, flipped

__all__ = ["Face", "Halved", "face", "halved", "heights"]

#: Share of the least height of its triangles within which a vertex is in the plane.
_IN_PLANE = 1e-3


class Halved(NamedTuple):
    """What a plane leaves of a mesh: points (k, 3), triangles (f, 3), edges (e, 2) of the rim as they turn about the
    face, and the matrix (k rows) that takes a field of the whole mesh's vertices to what is left.
    """

    points: Array
    triangles: Array
    rim: Array
    taken: sparse.csr_array


class Face(NamedTuple):
    """Points (k, 3), the first of which are those of the rim `numbers` (r) in the half, and triangles (f, 3)."""

    points: Array
    triangles: Array
    numbers: Array


def heights(points: Array, triangles: Array) -> Array:
    """Return the least height (v) of the triangles (f, 3) about each of the points (v, 3)."""
    corners = points[triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    least = np.full(len(points), np.inf)
    low = doubled / np.maximum(edges.max(axis=1), 1e-300)
    np.minimum.at(least, triangles.ravel(), np.repeat(low, 3))
    return least


def halved(points: Array, triangles: Array, point: Array, normal: Array) -> Halved:
    """Return what is left of a closed mesh (v, 3), (f, 3) below the plane through `point` with a unit normal (3).

    Vertices that are as good as in the plane are put into it.
    """
    x, t = points, np.asarray(triangles, np.int64)
    away = (x - point) @ normal
    side = np.where(np.abs(away) <= _IN_PLANE * heights(x, t), 0, np.sign(away)).astype(np.int64)
    low, high = side[t].min(axis=1), side[t].max(axis=1)
    crossed = t[(low < 0) & (high > 0)]
    through = (side[crossed] == 0).any(axis=1)
    # a corner that is alone on its side, or in the plane, comes first; turning keeps which side is outside
    sides = side[crossed]
    alone = np.argmax(np.where(through[:, None], sides == 0, sides == -np.sign(sides.sum(axis=1))[:, None]), axis=1)
    a, b, c = np.take_along_axis(crossed, (alone[:, None] + [0, 1, 2]) % 3, axis=1).T
    lone, other = np.where(through, b, a), np.where(through, c, b)
    ends = np.stack([np.stack([lone, other], -1), np.stack([lone, c], -1)])
    keys, number = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    share = away[keys[:, 0]] / (away[keys[:, 0]] - away[keys[:, 1]])
    p, q = number.reshape(2, -1) + len(x)
    below, beyond = ~through & (side[a] < 0), ~through & (side[a] > 0)
    kept = [
        t[(low < 0) & (high <= 0)],
        np.stack([a, p, q], -1)[below],
        np.stack([p, b, c], -1)[beyond],
        np.stack([p, c, q], -1)[beyond],
        np.stack([a, b, p], -1)[through & (side[b] < 0)],
        np.stack([a, p, c], -1)[through & (side[b] > 0)],
    ]
    cuts = np.arange(len(keys))
    between = sparse.csr_array(
        (np.concatenate([1 - share, share]), (np.concatenate([cuts, cuts]), keys.T.ravel())), shape=(len(keys), len(x))
    )
    whole = np.concatenate(kept)
    used, again = np.unique(whole, return_inverse=True)
    taken = sparse.csr_array(sparse.csr_array(sparse.vstack([sparse.eye_array(len(x)), between]))[used])
    flat = np.concatenate([side == 0, np.ones(len(keys), np.bool_)])[used]
    left, sheet = np.asarray(taken @ x), again.reshape(whole.shape)
    left[flat] -= ((left[flat] - point) @ normal)[:, None] * normal
    rim = bordered(sheet)[:, ::-1]
    return Halved(left, sheet, rim[flat[rim].all(axis=1)], taken)


def face(half: Halved, point: Array, normal: Array, gap: float) -> Face:
    """Return the cut face of a half: its rim and an even net of points about `gap` apart within it."""
    numbers = np.unique(half.rim)
    outline = half.points[numbers]
    right = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    right /= np.linalg.norm(right)
    up = np.cross(normal, right)
    flat = np.stack([(outline - point) @ right, (outline - point) @ up], -1)
    low, high = flat.min(axis=0), flat.max(axis=0)
    axes = [np.arange(low[k] + gap / 2, high[k], gap) for k in range(2)]
    net = np.stack(np.meshgrid(*axes), -1).reshape(-1, 2)
    rim = np.searchsorted(numbers, half.rim)
    segments = flat[rim]
    # what is nearer to the rim than its own edges are long would hide them from Delaunay's triangles
    longest = float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max())
    net = net[(KDTree(flat).query(net)[0] > 0.75 * longest) & _within(net, segments)]
    points = np.concatenate([flat, net])
    found = np.asarray(Delaunay(points).simplices, np.int64)
    a, b, c = points[found].transpose(1, 0, 2)
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    found[turn < 0] = found[turn < 0][:, ::-1]
    found = flipped(points, found[np.abs(turn) > 1e-14], rim)
    found = found[_within(points[found].mean(axis=1), segments)]
    found = filled(points, found, rim)
    points, found = _apart(points, found, numbers, half.triangles)
    inside = points[len(numbers) :]
    placed = point + inside[:, :1] * right + inside[:, 1:] * up
    return Face(np.concatenate([outline, placed]), found, numbers)


def _apart(points: Array, triangles: Array, numbers: Array, skin: Array) -> tuple[Array, Array]:
    """Return a face (k, 2), (f, 3) that has no edge of its inside in common with the skin: such are parted midway.

    The tip of a furrow that just reaches the plane lies under the middle of the face.
    """
    count = int(max(skin.max(), numbers.max())) + 1
    known = np.full(len(points), -1)
    known[: len(numbers)] = numbers
    edges = np.sort(skin[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    there = np.unique(edges[:, 0] * count + edges[:, 1])
    while True:
        rim = {tuple(sorted(edge)) for edge in bordered(triangles).tolist()}
        ways = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        ways = ways[(ways < len(numbers)).all(axis=1)]
        ends = np.sort(known[ways], axis=1)
        both = ways[np.isin(ends[:, 0] * count + ends[:, 1], there)]
        shared = [edge for edge in map(tuple, np.unique(both, axis=0).tolist()) if edge not in rim]
        if not shared:
            return points, triangles
        u, v = shared[0]
        has = (triangles == u).any(axis=1) & (triangles == v).any(axis=1)
        parted = np.concatenate([np.where(triangles[has] == w, len(points), triangles[has]) for w in (u, v)])
        points = np.concatenate([points, points[[u, v]].mean(axis=0, keepdims=True)])
        triangles = np.concatenate([triangles[~has], parted])


def _within(points: Array, segments: Array) -> Array:
    """Return which points (k, 2) an outline of segments (s, 2, 2) in any order encloses, by crossings to the right."""
    (ax, ay), (bx, by) = segments[:, 0].T, segments[:, 1].T
    found = np.empty(len(points), np.bool_)
    for begin in range(0, len(points), 2048):
        x, y = points[begin : begin + 2048, 0, None], points[begin : begin + 2048, 1, None]
        spans = (ay > y) != (by > y)
        where = ax + (y - ay) / np.where(by == ay, 1.0, by - ay) * (bx - ax)
        found[begin : begin + 2048] = (spans & (where > x)).sum(axis=1) % 2 == 1
    return found
