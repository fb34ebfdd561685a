"""Where pressure and compression push, and how deep vertices are in solids."""

from __future__ import annotations

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ..solids import Plane, Solid, SolidBox, SolidMesh

__all__ = ["area_vectors", "balanced", "compressed", "depth_in", "half_way"]


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


def depth_in(solid: Solid, x: Floats) -> tuple[Floats, Floats]:
    """Return how deep vertices are in a solid (n,), 0 outside, and the way out (n, 3)."""
    if isinstance(solid, Plane):
        normal = np.array(solid.normal) / np.linalg.norm(solid.normal)
        return np.maximum((np.array(solid.point) - x) @ normal, 0.0), np.broadcast_to(normal, x.shape)
    way = x - np.array(solid.centre)
    if isinstance(solid, SolidMesh):
        return _depth_in_mesh(solid, way)
    if isinstance(solid, SolidBox):
        return _depth_in_box(solid, way)
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    return np.maximum(solid.radius - distance, 0.0), way / distance[:, None]


def half_way(solid: Solid) -> float:
    """Return half of what it is from a solid's surface to its middle at least."""
    return solid.thick / 2


def _depth_in_mesh(solid: SolidMesh, way: Floats) -> tuple[Floats, Floats]:
    """Return depths and ways out of a mesh, `way` (n, 3) being places from its origin."""
    signed = solid.mesh.signed
    # only what is in the box about it can be in it
    near = ((way > signed.low) & (way < signed.high)).all(axis=1)
    depth, out = np.zeros(len(way)), np.tile([0.0, 0.0, 1.0], (len(way), 1))
    found, out[near] = signed.depth(way[near])
    depth[near] = np.maximum(found, 0.0)
    return depth, out


def _depth_in_box(box: SolidBox, way: Floats) -> tuple[Floats, Floats]:
    """Return depths and ways out of a box, `way` (n, 3) being places from its centre."""
    signs = np.where(way < 0, -1.0, 1.0)
    # how far beyond the box without its rounding: outside of that the nearest point is on it, inside a side is
    beyond = np.abs(way) - (np.array(box.size) / 2 - box.edge)
    outside = np.maximum(beyond, 0.0)
    away = np.linalg.norm(outside, axis=1)
    nearest = np.eye(3)[np.argmax(beyond, axis=1)]
    depth = box.edge - np.where(away > 0, away, beyond.max(axis=1))
    normal = np.where(away[:, None] > 0, outside / np.maximum(away, 1e-300)[:, None], nearest)
    return np.maximum(depth, 0.0), signs * normal
