"""Points that ride on a surface, and the points of a surface nearest to others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from ..arrays import Floats, Ints

__all__ = ["Anchors", "Corners", "corners_of", "on_surface", "place"]


@dataclass(frozen=True, eq=False)
class Anchors:
    """Points that ride on the surface: faces (m,) and barycentric weights (m, 3)."""

    faces: Ints
    weights: Floats

    def at(self, x: Floats, triangles: Ints) -> Floats:
        """Return where they are (m, 3)."""
        found: Floats = np.einsum("mk,mkc->mc", self.weights, x[triangles[self.faces]])
        return found


class Corners(NamedTuple):
    """Triangles to look for points in: corners (f, 3, 3), middles (f, 3), how far corners are from there (f,)."""

    at: Floats
    middles: Floats
    sizes: Floats


def corners_of(x: Floats, triangles: Ints) -> Corners:
    """Return the triangles of a surface."""
    middles, sizes = np.empty((len(triangles), 3)), np.empty(len(triangles))
    _middles(x, triangles, middles, sizes)
    return Corners(x[triangles], middles, sizes)


@njit(cache=True)
def _middles(x: Floats, triangles: Ints, middles: Floats, sizes: Floats) -> None:
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        for d in range(3):
            middles[t, d] = (x[i, d] + x[j, d] + x[k, d]) / 3
        largest = 0.0
        for v in (i, j, k):
            square = 0.0
            for d in range(3):
                square += (x[v, d] - middles[t, d]) ** 2
            largest = max(largest, square)
        sizes[t] = np.sqrt(largest)


def place(points: Floats, x: Floats, triangles: Ints) -> Anchors:
    """Return the nearest points of a surface to `points` (m, 3)."""
    return _placed(points, corners_of(x, triangles))


def on_surface(anchors: Anchors, x: Floats, triangles: Ints, corners: Corners) -> Anchors:
    """Return the anchors of the same places on the triangles `corners` that took the place of others."""
    return _placed(anchors.at(x, triangles), corners)


def _placed(points: Floats, corners: Corners) -> Anchors:
    faces, weights = zip(*(_nearest(point, corners) for point in np.atleast_2d(points)), strict=True)
    return Anchors(np.array(faces, np.int64), np.array(weights))


def _nearest(point: Floats, corners: Corners) -> tuple[int, Floats]:
    """Return triangle and barycentric weights of the point of the surface nearest to `point`."""
    # a triangle further off than the nearest middle and its own size need not be looked at
    away = np.linalg.norm(corners.middles - point, axis=1)
    near = np.flatnonzero(away - corners.sizes <= away.min() * (1 + 1e-12))
    p = corners.at[near]
    a, b, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], point - p[:, 0]
    aa, ab, bb = (a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)
    av, bv = (a * v).sum(-1), (b * v).sum(-1)
    determinant = np.maximum(aa * bb - ab * ab, 1e-300)
    s, t = (bb * av - ab * bv) / determinant, (aa * bv - ab * av) / determinant
    inner = np.stack([1 - s - t, s, t], -1)
    candidates = [np.where((inner >= 0).all(axis=1, keepdims=True), inner, np.nan)]
    for k in range(3):
        start, way = p[:, k], p[:, (k + 1) % 3] - p[:, k]
        u = np.clip(((point - start) * way).sum(-1) / np.maximum((way * way).sum(-1), 1e-300), 0, 1)
        weights = np.zeros((len(p), 3))
        weights[:, k], weights[:, (k + 1) % 3] = 1 - u, u
        candidates.append(weights)
    stacked = np.stack(candidates)
    gaps = np.linalg.norm(np.einsum("cfk,fkd->cfd", stacked, p) - point, axis=-1)
    best, face = np.unravel_index(np.nanargmin(gaps), gaps.shape)
    return int(near[face]), stacked[best, face]
