"""What an edge grows by, agreed between the two triangles that share it.

Were growth that differs from place to place even in each triangle, two neighbours would have their common edge grow by
different amounts, which no shape can satisfy: energy that falls with the square of the mesh, and is none of the
sheet's. Each edge grows by the mean of its tips (Combaz and Neyret 2004), by one amount.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Ints
from ...shell.membrane import squares

__all__ = ["agreed"]

#: Share of the area by even growth, squared, below which a triangle grows evenly.
_LEAST = 0.25


def agreed(before: Floats, after: Floats, ratios: Floats, face_edges: Ints, edges: int) -> Floats:
    """Return metrics (m, 3) of triangles whose edges grow by the mean of what their triangles say.

    before, after: rest metrics (m, 3), after by even growth in each triangle. ratios: (m, 3) what squared edges are to
    grow by, as each triangle sees its directions. face_edges: (m, 3) numbers, below `edges`, of their edges, edge k
    opposite to corner k. What neighbours disagreed on before stays. A triangle that would come near to collapsing grows
    evenly.
    """
    at = face_edges.ravel()
    mean = np.bincount(at, ratios.ravel(), edges) / np.maximum(np.bincount(at, minlength=edges), 1)
    a, b, c = (squares(before) * mean[face_edges]).T
    found = np.stack([c, (b + c - a) / 2, b], -1)
    sound = _determinant(found) > _LEAST * _determinant(after)
    return np.where(sound[:, None], found, after)


def _determinant(g: Floats) -> Floats:
    return np.asarray(g[:, 0] * g[:, 2] - g[:, 1] ** 2)
