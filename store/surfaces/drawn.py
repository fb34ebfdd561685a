"""The closed triangle mesh that a lattice surface is handed over as: its normals and its volume.

A quad between rows i, i + 1 and columns j, j + 1 (which wrap) is the triangles (a, b, c) and (b, d, c) of its corners
a (i, j), b (i, j + 1), c (i + 1, j) and d (i + 1, j + 1); around each pole lies a fan. `solver.lattice` cuts alike.

Rows lie behind each other in one line, each with its first point once more at its end, so that the four corners of
all quads are four stretches of it. Those that run on from the end of a row into the next have b = c, and count nothing.
"""

from __future__ import annotations

import numpy as np

from solver.arrays import Array, Singles

from . import steps

__all__ = ["normals", "volume"]

#: A fan's row, and the sense of its turn as seen from outside.
_FANS = ((0, -1), (-1, 1))
#: Where a vertex and the centre are one place, as in a surface that has vanished.
_UP = np.array([0.0, 1.0, 0.0], dtype=np.float32)


def normals(position: Array, poles: Array) -> tuple[Singles, Singles]:
    """Return outward unit normals of a lattice surface (n, 2n, 3), and those (2, 3) of its poles (2, 3).

    The mean of the triangles about a vertex, weighted by area: whatever the surface does between its points, they are
    those of the mesh that is drawn, and of a picture or an export (the derivatives of the surface's series are turned
    by over 90 degrees at hundreds of points of a folded one). Beside the poles, where triangles change their size from
    row to row, they lean away from the pole by up to a share of a cell: by 1 degree of a ball at n = 64. A vertex
    whose triangles cancel borrows the direction from the centre: glTF allows no zero normal.
    """
    line = _line(position)
    a, b, c, d = _corners(line)
    upper, lower = _cross(b - a, c - a), _cross(d - c, d - b)
    sums = np.zeros_like(line)
    of_a, of_b, of_c, of_d = _corners(sums)
    of_a += upper
    of_d += lower
    upper += lower
    of_b += upper
    of_c += upper
    rows, total = line.reshape(3, len(position), -1), sums.reshape(3, len(position), -1)
    ends = np.empty((2, 3), position.dtype)
    for end, (row, turn) in enumerate(_FANS):
        spokes = rows[:, row] - poles[end][:, None]
        fan = turn * _cross(spokes[:, :-1], spokes[:, 1:])
        total[:, row, :-1] += fan
        total[:, row, 1:] += fan
        ends[end] = fan.sum(axis=1)
    total[:, :, 0] += total[:, :, -1]
    return _unit(total[:, :, :-1], position), _unit(ends.T, poles)


def volume(position: Array, poles: Array) -> float:
    """Return the volume [r1^3] inside the triangles of a lattice surface (n, 2n, 3) with its poles (2, 3)."""
    return float(steps.now().six(np.require(position, requirements=["C", "W"]), poles.astype(position.dtype)).sum()) / 6


def _line(position: Array) -> Array:
    """Return points (n, 2n, 3) as (3, n (2n + 1)): the rows in a line, each with its first point again at its end."""
    n, wide = position.shape[:2]
    line = np.empty((3, n, wide + 1), position.dtype)
    line[:, :, :-1] = np.moveaxis(position, -1, 0)
    line[:, :, -1] = line[:, :, 0]
    return line.reshape(3, -1)


def _corners(line: Array) -> tuple[Array, Array, Array, Array]:
    """Return views of a line at the corners a, b, c and d of all quads."""
    n = int((line.shape[1] / 2) ** 0.5)
    south = 2 * n + 1
    return line[:, : -south - 1], line[:, 1:-south], line[:, south:-1], line[:, south + 1 :]


def _cross(a: Array, b: Array) -> Array:
    out = np.empty_like(a)
    part = np.empty_like(a[0])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=out[i])
        np.multiply(a[k], b[j], out=part)
        out[i] -= part
    return out


def _unit(planes: Array, instead: Array) -> Singles:
    """Return vectors (3, ...) as (..., 3) at length 1; where they have none, that of the vectors (..., 3) `instead`."""
    length = np.sqrt(np.einsum("i...,i...->...", planes, planes))
    none = length == 0
    length[none] = 1
    out = np.empty((*length.shape, 3), np.float32)
    for i, plane in enumerate(planes):
        np.divide(plane, length, out=out[..., i], casting="same_kind")
    if none.any():
        there = instead[none]
        far = np.linalg.norm(there, axis=-1, keepdims=True)
        out[none] = np.where(far > 0, there / np.where(far > 0, far, 1), _UP)
    return out
