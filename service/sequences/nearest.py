"""The nearest point of a triangle mesh to each of many points, exactly, with a tree over the triangles' middles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from solver.arrays import Array, Ints

__all__ = ["Nearest", "nearest"]


#: Triangles tried first; whoever could still have a nearer one than these tries all within reach.
_FIRST = 8
_CHUNK = 20_000


class Nearest(NamedTuple):
    """Where each point was bound: a triangle (p), shares of its corners (p, 3), and how far away it is (p)."""

    face: Ints
    shares: Array
    distance: Array


def nearest(points: Array, vertices: Array, triangles: Array) -> Nearest:
    """Return the nearest point of a mesh (v, 3), (f, 3) for every point (p, 3)."""
    from trimesh.triangles import points_to_barycentric

    corners = np.asarray(vertices, float)[triangles]
    middles = corners.mean(axis=1)
    reach = float(np.linalg.norm(corners - middles[:, None], axis=2).max())
    tree = KDTree(middles)
    count = min(_FIRST, len(triangles))
    face, place, distance = (np.zeros(len(points), np.int64), np.zeros((len(points), 3)), np.zeros(len(points)))
    for start in range(0, len(points), _CHUNK):
        part = slice(start, start + _CHUNK)
        here = np.asarray(points[part], float)
        found = tree.query(here, k=count)
        far, candidates = (np.asarray(item).reshape(len(here), count) for item in found)
        owner = np.repeat(np.arange(len(here)), count)
        face[part], place[part], distance[part] = _best(here, corners, owner, candidates.ravel())
        # a triangle whose middle is farther than this cannot be nearer than the best so far
        open_ = np.flatnonzero(distance[part] + reach > far[:, -1]) if count < len(triangles) else np.empty(0, int)
        if len(open_):
            lists = tree.query_ball_point(here[open_], distance[part][open_] + reach)
            owner = np.repeat(np.arange(len(open_)), [len(found) for found in lists])
            better = _best(here[open_], corners, owner, np.concatenate(lists).astype(np.int64))
            where = start + open_
            face[where], place[where], distance[where] = better
    shares = np.asarray(points_to_barycentric(corners[face], place, method="cross"), np.float64)
    shares = np.where(np.isfinite(shares), shares, 1 / 3)  # a triangle without area
    shares = np.clip(shares, 0, None)
    return Nearest(face, shares / shares.sum(axis=1, keepdims=True), distance)


def _best(points: Array, corners: Array, owner: Array, candidates: Array) -> tuple[Array, Array, Array]:
    """Return the nearest candidate of every point, its nearest place and the distance. `owner` rises, none missing."""
    from trimesh.triangles import closest_point

    places = np.asarray(closest_point(corners[candidates], points[owner]))
    away = np.linalg.norm(places - points[owner], axis=1)
    order = np.lexsort((away, owner))
    first = order[np.searchsorted(owner[order], np.arange(len(points)))]
    return candidates[first], places[first], away[first]
