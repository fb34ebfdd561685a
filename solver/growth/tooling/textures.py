"""Expansion textures: values on a grid, laid on a surface by a map; spots and stripes by reaction."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.ndimage import map_coordinates

from ...arrays import Floats, Ints
from ...contract import Context, InvalidInput
from ..shapes import Ground

__all__ = ["UNMAPPED", "Projection", "gray_scott", "laid", "laid_within"]

Projection = Literal["x", "y", "z", "round", "sphere", "uv"]
#: What to do where there are no texture coordinates.
UNMAPPED = (
    "give a `mesh` that has texture coordinates (vt in OBJ, TEXCOORD_0 in GLB), or take another projection: x, y, z, "
    "round, sphere"
)


def laid(values: Floats, ground: Ground, projection: Projection, points: Floats | None = None) -> Floats:
    """Return the texture's values (rows, columns), the first row low, bilinear, at vertices or `points` (n, 3).

    x, y, z: seen along that axis, over the surface's box, the next two axes across (columns) and up (rows).
    round: columns about the z axis from x, periodic; rows along z.
    sphere: as seen from the origin, rows by the angle to z, columns about z from x towards -y. Values are at the
    middles of cells, and beyond a pole the rows go on on the other side. Turned so that y is up, as in files, that is
    how maps of bodies whose poles are on y are laid out.
    uv: by texture coordinates, values at the middles of cells; columns repeat, and so do rows, each tile by itself. A
    vertex on a seam has the mean of its triangles' corners.

    Raises:
        InvalidInput: there are no texture coordinates.

    """
    every = ground.mesh.x
    x = every if points is None else points
    if projection == "uv":
        if ground.uv is None:
            raise InvalidInput("a texture lies by texture coordinates, and the surface has none.", advice=UNMAPPED)
        return _by_corners(values, ground.uv, ground)
    if projection == "sphere":
        return _around_middle(values, x)
    if projection == "round":
        u = (np.arctan2(x[:, 1], x[:, 0]) / (2 * np.pi)) % 1.0 * values.shape[1]
        v = _shares(x[:, 2], every[:, 2]) * (len(values) - 1)
        wide = np.concatenate([values, values[:, :1]], axis=1)
        return np.asarray(map_coordinates(wide, [v, u], order=1, mode="nearest"))
    first = ("xyz".index(projection) + 1) % 3
    second = (first + 1) % 3
    u = _shares(x[:, first], every[:, first]) * (values.shape[1] - 1)
    v = _shares(x[:, second], every[:, second]) * (len(values) - 1)
    return np.asarray(map_coordinates(values, [v, u], order=1, mode="nearest"))


def laid_within(values: Floats, ground: Ground, projection: Projection, some: Ints, weights: Floats) -> Floats:
    """Return the texture's values (m, k) within triangles `some` (m,), at barycentric weights (k, 3); see `laid`.

    Raises:
        InvalidInput: there are no texture coordinates.

    """
    if projection == "uv" and ground.uv is not None:
        return _by_coordinates(values, weights @ ground.uv[some]).reshape(len(some), -1)
    points = (weights @ ground.mesh.x[ground.mesh.triangles[some]]).reshape(-1, 3)
    return laid(values, ground, projection, points).reshape(len(some), -1)


def _around_middle(values: Floats, x: Floats) -> Floats:
    """Return the values at the directions of points (n, 3) from the origin."""
    n, m = values.shape
    rows = np.concatenate([np.roll(values[:1], m // 2, axis=1), values, np.roll(values[-1:], m // 2, axis=1)])
    up = 1 - np.arctan2(np.hypot(x[:, 0], x[:, 1]), x[:, 2]) / np.pi
    along = np.arctan2(-x[:, 1], x[:, 0]) / (2 * np.pi) % 1.0
    return _repeating(rows, up * n + 0.5, along * m)


def _by_corners(values: Floats, uv: Floats, ground: Ground) -> Floats:
    """Return the means of the values at the texture coordinates (f, 3, 2) of each vertex's corners."""
    found = _by_coordinates(values, uv)
    corners, count = ground.mesh.triangles.ravel(), len(ground.mesh.x)
    return np.bincount(corners, found, count) / np.maximum(np.bincount(corners, minlength=count), 1)


def _by_coordinates(values: Floats, uv: Floats) -> Floats:
    """Return the values at texture coordinates (..., 2), end to end."""
    u, v = uv.reshape(-1, 2).T
    inside = np.where((v >= 0) & (v <= 1), v, v % 1.0)
    return _repeating(values, inside * len(values) - 0.5, u % 1.0 * values.shape[1])


def _repeating(rows: Floats, down: Floats, along: Floats) -> Floats:
    """Return the values at rows `down`, and columns `along` whose middles are at halves, which repeat."""
    wide = np.concatenate([rows[:, -1:], rows, rows[:, :1]], axis=1)
    return np.asarray(map_coordinates(wide, [down, along + 0.5], order=1, mode="nearest"))


def _shares(v: Floats, every: Floats) -> Floats:
    return np.asarray((v - every.min()) / max(float(np.ptp(every)), 1e-300))


# what is held is looked up again where remeshing made other triangles
@lru_cache(maxsize=4)
def gray_scott(feed: float, kill: float, size: int, steps: int, seed: int) -> Floats:
    """Return the second substance (size, size) of Gray and Scott's reaction, periodic, scaled to 0 to 1.

    Pearson 1993's diffusivities and grid spacing 1 in our units (0.16 and 0.08, time step 1), from seeded squares.
    """
    generator = Context.generator(seed)
    u, v = np.ones((size, size)), np.zeros((size, size))
    for i, j in generator.integers(0, size, (max(4, size * size // 120), 2)):
        rows, columns = np.ix_((i + np.arange(4)) % size, (j + np.arange(4)) % size)
        u[rows, columns], v[rows, columns] = 0.5, 0.25
    for _ in range(steps):
        reaction = u * v * v
        u += 0.16 * _around(u) - reaction + feed * (1 - u)
        v += 0.08 * _around(v) + reaction - (feed + kill) * v
    return np.asarray((v - v.min()) / max(float(np.ptp(v)), 1e-300))


def _around(a: Floats) -> Floats:
    return np.roll(a, 1, 0) + np.roll(a, -1, 0) + np.roll(a, 1, 1) + np.roll(a, -1, 1) - 4 * a
