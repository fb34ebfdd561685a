"""Expansion textures: values on a grid, laid on a surface by a temporary uv map; spots and stripes by reaction."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.ndimage import map_coordinates

from ...arrays import Floats
from ...contract import Context

__all__ = ["Projection", "gray_scott", "laid"]

Projection = Literal["x", "y", "z", "round"]


def laid(values: Floats, x: Floats, projection: Projection) -> Floats:
    """Return the texture's values (rows, columns) at vertices (n, 3), bilinear.

    x, y, z: seen along that axis, over the surface's box, the next two axes across (columns) and up (rows).
    round: columns about the z axis from x, periodic; rows along z. The first row is low.
    """
    if projection == "round":
        u = (np.arctan2(x[:, 1], x[:, 0]) / (2 * np.pi)) % 1.0 * values.shape[1]
        v = _shares(x[:, 2]) * (len(values) - 1)
        wide = np.concatenate([values, values[:, :1]], axis=1)
        return np.asarray(map_coordinates(wide, [v, u], order=1, mode="nearest"))
    first = ("xyz".index(projection) + 1) % 3
    u = _shares(x[:, first]) * (values.shape[1] - 1)
    v = _shares(x[:, (first + 1) % 3]) * (len(values) - 1)
    return np.asarray(map_coordinates(values, [v, u], order=1, mode="nearest"))


def _shares(v: Floats) -> Floats:
    return np.asarray((v - v.min()) / max(float(np.ptp(v)), 1e-300))


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
