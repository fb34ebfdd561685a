"""Closed triangle meshes cut by a plane: what is left, its rim, and an even net of triangles that closes it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import Delaunay, KDTree

from ..arrays import Array

__all__ = ["Face", "Halved", "face", "halved"]

#: Nearer to the plane than this no vertex lies: it counts as left.
_IN_PLANE = 1e-9


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


def halved(points: Array, triangles: Array, point: Array, normal: Array) -> Halved:
    """Return what is left of a closed mesh (v, 3), (f, 3) below the plane through `point` with a unit normal (3)."""
    x, t = points, np.asarray(triangles, np.int64)
    away = (x - point) @ normal
    away = np.where(np.abs(away) < _IN_PLANE, -_IN_PLANE, away)
    out = away > 0
    count = out[t].sum(axis=1)
    crossed = t[(count == 1) | (count == 2)]
    # the corner that is alone on its side comes first; turning keeps which side is outside
    sides = out[crossed]
    alone = np.argmax(sides == (sides.sum(axis=1) == 1)[:, None], axis=1)
    a, b, c = np.take_along_axis(crossed, (alone[:, None] + [0, 1, 2]) % 3, axis=1).T
    ends = np.stack([np.stack([a, b], -1), np.stack([a, c], -1)])
    keys, number = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    share = away[keys[:, 0]] / (away[keys[:, 0]] - away[keys[:, 1]])
    p, q = number.reshape(2, -1) + len(x)
    lone_out = out[a]
    kept = [
        t[count == 0],
        np.stack([a, p, q], -1)[~lone_out],
        np.stack([p, b, c], -1)[lone_out],
        np.stack([p, c, q], -1)[lone_out],
    ]
    rim = np.where(lone_out[:, None], np.stack([q, p], -1), np.stack([p, q], -1))
    cuts = np.arange(len(keys))
    between = sparse.csr_array(
        (np.concatenate([1 - share, share]), (np.concatenate([cuts, cuts]), keys.T.ravel())), shape=(len(keys), len(x))
    )
    taken = sparse.csr_array(sparse.vstack([sparse.eye_array(len(x)), between]))
    whole = np.concatenate(kept)
    used, again = np.unique(whole, return_inverse=True)
    place = np.full(len(x) + len(keys), -1)
    place[used] = np.arange(len(used))
    taken = sparse.csr_array(taken[used])
    return Halved(np.asarray(taken @ x), again.reshape(whole.shape), place[rim], taken)


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
    place = np.full(int(numbers.max()) + 1, -1)
    place[numbers] = np.arange(len(numbers))
    segments = flat[place[half.rim]]
    # what is nearer to the rim than its own edges are long would hide them from Delaunay's triangles
    longest = float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max())
    net = net[(KDTree(flat).query(net)[0] > 0.75 * longest) & _within(net, segments)]
    points = np.concatenate([flat, net])
    found = Delaunay(points).simplices
    corners = points[found]
    found = found[_within(corners.mean(axis=1), segments)]
    a, b, c = points[found].transpose(1, 0, 2)
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    found[turn < 0] = found[turn < 0][:, ::-1]
    found = found[np.abs(turn) > 1e-14]
    inside = point + net[:, :1] * right + net[:, 1:] * up
    return Face(np.concatenate([outline, inside]), found, numbers)


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
