"""What an edge grows by, agreed between the two triangles that share it.

Growth that differs from place to place is taken as even in each triangle. So two neighbours would have their common
edge grow by different amounts, which no shape can satisfy: energy that falls with the square of the mesh, and is none
of the sheet's. Where each edge grows by one amount (the paper's: by the mean of its tips), that is gone.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Ints

__all__ = ["agreed"]

#: Of its own growth's area a triangle keeps at least this share, squared; else it keeps its own growth.
_LEAST = 0.25


def agreed(before: Floats, after: Floats, face_edges: Ints, edges: int) -> Floats:
    """Return metrics (m, 3) of triangles whose edges grow by the mean of what their triangles' own growth makes of it.

    before, after: rest metrics (m, 3), after by each triangle's own growth. face_edges: (m, 3) numbers, below `edges`,
    of their edges, edge k opposite to corner k. An edge that one of the triangles has alone grows by its own; what they
    disagreed on before stays. A triangle that would come near to collapsing keeps its own growth.
    """
    old = _squares(before)
    ratios = _squares(after) / old
    at = face_edges.ravel()
    mean = np.bincount(at, ratios.ravel(), edges) / np.maximum(np.bincount(at, minlength=edges), 1)
    a, b, c = (old * mean[face_edges]).T
    found = np.stack([c, (b + c - a) / 2, b], -1)
    sound = _determinant(found) > _LEAST * _determinant(after)
    return np.where(sound[:, None], found, after)


def _squares(g: Floats) -> Floats:
    """Return the squared edges (m, 3) of metrics."""
    return np.stack([g[:, 0] + g[:, 2] - 2 * g[:, 1], g[:, 2], g[:, 0]], -1)


def _determinant(g: Floats) -> Floats:
    return np.asarray(g[:, 0] * g[:, 2] - g[:, 1] ** 2)
