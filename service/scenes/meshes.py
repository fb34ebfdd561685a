"""Shapes as quantised vertices: positions in 13 bits, normals in 8, and colours, those of ridges and furrows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from solver.arrays import Array, Floats
from solver.contract import Worn
from store.shape import Shape

from ..formats import mesh

__all__ = ["STEPS", "VERTEX", "Packed", "pack", "quantised", "relief", "weathered"]

#: One vertex: 16 bytes, multiples of four as accessors want them.
VERTEX = np.dtype([("position", "<i2", 4), ("normal", "i1", 4), ("colour", "u1", 4)])
#: Height [r1] over the smoothed shape from furrow to ridge, and the share of ridge where it is smooth.
_DEEP, _FLAT = 0.05, 0.6
#: Largest coordinate as a number: half a step is 1.2e-4 of the radius. More bits would be noise, and half the file.
STEPS = 4095
#: Shades from furrow to ridge.
_SHADES = 32


class Packed(NamedTuple):
    """Vertices (v) as `VERTEX`; a position times `scale` is in the kind's unit."""

    vertices: Array
    scale: float
    low: list[int]
    high: list[int]


def relief(position: Array, normal: Array) -> Floats:
    """Return how high (n, 2n) a lattice surface stands over itself smoothed over an eighth of the way pole to pole."""
    n = len(position)
    wide = max(n // 8, 1) | 1
    # across a pole a column goes on half a turn further
    over = np.roll(position, n, axis=1)
    tall = np.concatenate([over[:wide][::-1], position, over[-wide:][::-1]])
    smooth = uniform_filter1d(uniform_filter1d(tall, wide, axis=0), wide, axis=1, mode="wrap")[wide:-wide]
    return np.asarray(np.einsum("ijk,ijk->ij", position - smooth, normal))


def weathered(position: Array, normal: Array, looks: Worn) -> Floats:
    """Return colours (2 n^2 + 2, 3) over the skin's base of a lattice surface (n, 2n, 3) and its poles."""
    height = relief(position, normal)
    # a smoothed round body lies within it: only what stands out of the mean is ridge
    height = height - np.median(height)
    share = np.clip(_FLAT + height / _DEEP, 0, 1)
    share = np.concatenate([share.ravel(), [share[0].mean(), share[-1].mean()]])[:, None]
    share = np.round(share * _SHADES) / _SHADES
    return np.asarray((looks.furrow * (1 - share) + looks.ridge * share) / looks.base)


def quantised(points: Array, normal: Array, colour: Floats, reach: float) -> Packed:
    """Return vertices of points, normals and colours over the skin's base (v, 3); `reach` is the largest coordinate
    that counts.
    """
    scale = reach / STEPS
    out = np.zeros(len(points), VERTEX)
    out["position"][:, :3] = np.round(points / scale)
    out["normal"][:, :3] = np.round(normal * 127)
    out["colour"][:, :3] = np.round(np.clip(colour, 0, 1) * 255)
    out["colour"][:, 3] = 255
    columns = [out["position"][:, i] for i in range(3)]
    return Packed(out, scale, [int(c.min()) for c in columns], [int(c.max()) for c in columns])


def pack(shape: Shape, looks: Worn, reach: float | None = None) -> Packed:
    """Return a shape's closed mesh, 2 n^2 + 2 vertices, quantised; `reach` [r1] is the largest coordinate that counts,
    None: the shape's own.
    """
    position, ends = mesh.surface(shape)
    points, normal = mesh.vertices(position, ends), mesh.vertices(shape.normals, shape.pole_normals)
    colour = weathered(position, shape.normals, looks)
    return quantised(points, normal, colour, float(np.abs(points).max()) if reach is None else reach)
