"""Where pressure and compression push, and how far in solids push."""

from __future__ import annotations

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ..solids import Solid

__all__ = ["area_vectors", "balanced", "compressed", "half_way"]


def area_vectors(x: Floats, triangles: Ints) -> Floats:
    """Return a third of the area vectors of each vertex's triangles (n, 3)."""
    p = x[triangles]
    third = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 6
    return np.stack([np.bincount(triangles.ravel(), np.repeat(third[:, c], 3), len(x)) for c in range(3)], -1)


def compressed(x: Floats, triangles: Ints, g: Floats, lame: float, thick: Floats | None = None) -> Floats:
    """Return the compression of triangles, turned into forces along their normals, at vertices (n, 3).

    The normal stress F_N of Combaz and Neyret: each triangle's compressive resultant, -(1 + lame) tr(e) [mu] where that
    is positive, the mean of its two principal stresses, times its area vector; and times thick (f,), its thickness over
    the sheet's.
    """
    now = shell.metric(x, triangles)
    # half the trace of a - g, indices raised by g
    trace = (g[:, 2] * now[:, 0] - 2 * g[:, 1] * now[:, 1] + g[:, 0] * now[:, 2]) / (g[:, 0] * g[:, 2] - g[:, 1] ** 2)
    squeezed = np.maximum(-(1 + lame) * (trace - 2) / 2, 0.0)
    squeezed = squeezed if thick is None else squeezed * thick
    p = x[triangles]
    third = squeezed[:, None] * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 6
    return np.stack([np.bincount(triangles.ravel(), np.repeat(third[:, c], 3), len(x)) for c in range(3)], -1)


def balanced(load: Floats, areas: Floats, motions: Floats) -> Floats:
    """Return a load (n, 3) without what would move the whole along rigid motions (3n, k), taken off by areas (n,).

    What a sheet does to itself cannot push it away.
    """
    if not motions.shape[1]:
        return load
    weighted = np.repeat(areas, 3)[:, None] * motions
    return load - (weighted @ np.linalg.solve(motions.T @ weighted, motions.T @ load.ravel())).reshape(load.shape)


def half_way(solid: Solid) -> float:
    """Return half of what it is from a solid's surface to its middle at least."""
    return solid.thick / 2
