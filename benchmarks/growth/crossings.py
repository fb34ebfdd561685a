"""Where a mesh passes through itself: pairs of an edge and a triangle that cross."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

__all__ = ["crossings"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_AT_ONCE = 2_000_000
#: Least volume of an edge and a triangle that can cross, over the product of their lengths.
_FLAT = 1e-6


def crossings(x: Floats, triangles: Ints) -> int:
    """Return how many edges of the mesh (x (n, 3), triangles (f, 3)) pass through triangles without a common vertex."""
    pairs = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    edges = np.unique(pairs, axis=0)
    middles, centres = x[edges].mean(axis=1), x[triangles].mean(axis=1)
    half = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1).max() / 2
    reach = half + np.linalg.norm(x[triangles] - centres[:, None], axis=-1).max()
    near = KDTree(middles).query_ball_tree(KDTree(centres), reach)
    e = np.repeat(np.arange(len(edges)), [len(found) for found in near])
    f = np.concatenate([np.array(found, np.int64) for found in near])
    apart = (edges[e][:, :, None] != triangles[f][:, None, :]).all(axis=(1, 2))
    e, f = e[apart], f[apart]
    return sum(
        _cross(x[edges[e[at : at + _AT_ONCE]]], x[triangles[f[at : at + _AT_ONCE]]])
        for at in range(0, len(e), _AT_ONCE)
    )


def _cross(segments: Floats, corners: Floats) -> int:
    """Return how many segments (m, 2, 3) pass through their triangles (m, 3, 3) (Moeller and Trumbore 1997)."""
    way = segments[:, 1] - segments[:, 0]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(way, b)
    volume = (a * p).sum(-1)
    # in a flat part edges lie in the plane of their neighbours, but for rounding: they do not pass through it
    size = np.linalg.norm(way, axis=1) * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    good = np.abs(volume) > _FLAT * size
    inverse = 1 / np.where(good, volume, 1.0)
    offset = segments[:, 0] - corners[:, 0]
    u = (offset * p).sum(-1) * inverse
    q = np.cross(offset, a)
    v, t = (way * q).sum(-1) * inverse, (b * q).sum(-1) * inverse
    return int((good & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)).sum())
