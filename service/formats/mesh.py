"""The lattice as a closed triangle mesh: topology, seam, texture coordinates and normals.

Vertices are the n rows of 2n lattice points in row-major order, then the pole at colatitude 0 and the pole at pi.
Azimuth runs from x towards z about y, so d/dcolatitude x d/dazimuth points inwards; triangles therefore run along
azimuth first, which makes them counter-clockwise as seen from outside and the enclosed volume positive.

Texture coordinates follow the lattice (u = azimuth / 2 pi, v = colatitude / pi, v = 0 at the top), so that an image of
a surface field with one texel per sample lies where the field lies. They need a second copy of the first column at
u = 1 and one pole vertex per fan triangle; `seam` says which vertex each of these copies repeats.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.arrays import Array, Singles, Words32
from store.surfaces.drawn import normals

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["is_open", "normals", "seam", "seam_triangles", "surface", "texture", "triangles", "vertices"]


def _frozen(array: Words32) -> Words32:
    array.flags.writeable = False
    return array


def _join(rows: Words32, first: Words32, last: Words32) -> Words32:
    """Return triangles (4n^2, 3) between rows (n, 2n + 1) whose last column closes the seam, and two pole fans."""
    upper, lower = rows[:-1], rows[1:]
    a, b, c, d = upper[:, :-1], upper[:, 1:], lower[:, :-1], lower[:, 1:]
    quads = np.stack([a, b, c, b, d, c], axis=-1).reshape(-1, 3)
    top = np.stack([first, rows[0, 1:], rows[0, :-1]], axis=-1)
    bottom = np.stack([last, rows[-1, :-1], rows[-1, 1:]], axis=-1)
    return _frozen(np.ascontiguousarray(np.concatenate([top, quads, bottom])))


@lru_cache(maxsize=8)
def triangles(n: int) -> Words32:
    """Return the closed mesh's triangles (4n^2, 3): indices into the 2n^2 + 2 vertices of `vertices`."""
    rows = np.arange(2 * n * n, dtype=np.uint32).reshape(n, 2 * n)
    rows = np.concatenate([rows, rows[:, :1]], axis=1)
    pole = np.full(2 * n, 2 * n * n, dtype=np.uint32)
    return _join(rows, pole, pole + np.uint32(1))


@lru_cache(maxsize=8)
def seam_triangles(n: int) -> Words32:
    """Return the same triangles in the same order, as indices into the vertices of `seam` and `texture`."""
    rows = np.arange(n * (2 * n + 1), dtype=np.uint32).reshape(n, 2 * n + 1)
    pole = rows.size + np.arange(2 * n, dtype=np.uint32)
    return _join(rows, pole, pole + np.uint32(2 * n))


@lru_cache(maxsize=8)
def seam(n: int) -> NDArray[np.intp]:
    """Return, for each of the n (2n + 1) + 4n vertices of the cut-open mesh, the closed mesh's vertex it repeats."""
    rows = np.arange(2 * n * n).reshape(n, 2 * n)
    rows = np.concatenate([rows, rows[:, :1]], axis=1)
    out = np.concatenate([rows.ravel(), np.repeat([2 * n * n, 2 * n * n + 1], 2 * n)])
    out.flags.writeable = False
    return out


@lru_cache(maxsize=8)
def texture(n: int) -> Singles:
    """Return the texture coordinates (n (2n + 1) + 4n, 2) of the cut-open mesh's vertices."""
    u, v = np.meshgrid(np.arange(2 * n + 1) / (2 * n), (np.arange(n) + 0.5) / n)
    fan = (np.arange(2 * n) + 0.5) / (2 * n)  # the middle of the fan's triangle: no sample is stretched over the pole
    top, bottom = (np.stack([fan, np.full(2 * n, edge)], axis=-1) for edge in (0.0, 1.0))
    out = np.concatenate([np.stack([u, v], axis=-1).reshape(-1, 2), top, bottom]).astype(np.float32)
    out.flags.writeable = False
    return out


def surface(shape: Shape) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the positions (n, 2n, 3) and poles (2, 3) of a shape that was looked up with them.

    Raises:
        ValueError: it was looked up without.

    """
    if shape.position is None or shape.poles is None:
        raise ValueError("a mesh needs positions: look the shape up with fields=('position',)")
    return shape.position, shape.poles


def vertices(lattice: NDArray[np.floating], poles: NDArray[np.floating]) -> Singles:
    """Return a lattice field (n, 2n, 3) and its values (2, 3) at the poles as one array (2n^2 + 2, 3)."""
    return np.concatenate([lattice.reshape(-1, 3), poles], dtype=np.float32)


def is_open(points: Array, triangles: Array) -> bool:
    """Return whether a mesh (v, 3), (f, 3) of any kind has a rim, so that its inner side may be seen.

    Seams split vertices, and leave them where they are: what counts is the place.
    """
    corners = np.unique(points, axis=0, return_inverse=True)[1].ravel()[triangles].astype(np.int64)
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    low, high = edges[edges[:, 0] != edges[:, 1]].T
    _, counts = np.unique(low * len(points) + high, return_counts=True)
    return bool((counts % 2 == 1).any())
