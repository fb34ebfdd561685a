"""Fields on the fruit's own texture coordinates, as pictures: u = azimuth / 2 pi, v = colatitude / pi, v = 0 on top.

A texel is worth the field at its middle, bilinear between the lattice's samples: waves would ring where colours end.
Rows beyond a pole are those of the other side, so nothing is clamped there, and u runs around.
"""

from __future__ import annotations

import numpy as np

from solver.arrays import Array

__all__ = ["baked"]


def baked(field: Array, size: int) -> Array:
    """Return a field (n, 2n) or (n, 2n, c) as a picture (size, size) or (size, size, c), first row on top, float32."""
    from scipy import ndimage

    values = np.asarray(field, np.float32)
    if values.ndim == 3:
        return np.stack([baked(values[..., k], size) for k in range(values.shape[2])], axis=-1)
    n, m = values.shape
    rows = np.concatenate([np.roll(values[:1], m // 2, axis=1), values, np.roll(values[-1:], m // 2, axis=1)])
    rows = np.concatenate([rows, rows[:, :1]], axis=1)
    texel = (np.arange(size) + 0.5) / size
    down, along = texel * n + 0.5, texel * m  # row i of the lattice is row i + 1 here, and its middle is i + 1/2
    grid = np.meshgrid(down, along, indexing="ij")
    return ndimage.map_coordinates(rows, grid, order=1, mode="nearest", prefilter=False).astype(np.float32)
