"""The lattice that all surface fields live on: cell centres in colatitude, twice as many azimuths about the y axis."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from .arrays import Floats, Ints

if TYPE_CHECKING:
    from .contract import Region

__all__ = ["azimuths", "closed_lattice", "colatitudes", "directions", "lattice", "window"]


def colatitudes(resolution: int) -> Floats:
    """Return `resolution` colatitudes [radian] at cell centres, so that no sample sits on a pole."""
    return (np.arange(resolution) + 0.5) * np.pi / resolution


def azimuths(resolution: int) -> Floats:
    """Return the 2 * `resolution` azimuths [radian] that go with `colatitudes(resolution)`."""
    return np.arange(2 * resolution) * np.pi / resolution


@lru_cache(maxsize=8)
def lattice(resolution: int) -> tuple[Floats, Floats]:
    """Return the broadcast (colatitude, azimuth) grids [radian], each of shape (resolution, 2 * resolution)."""
    theta, phi = np.meshgrid(colatitudes(resolution), azimuths(resolution), indexing="ij")
    for grid in (theta, phi):
        grid.flags.writeable = False
    return theta, phi


def window(resolution: int, region: Region | None) -> tuple[slice, slice | Ints]:
    """Return the rows and columns of the lattice that lie inside a region; all of them if there is none.

    Columns of a region on both sides of azimuth 0 go from its beginning to its end.
    """
    if region is None:
        return slice(None), slice(None)
    top, bottom = np.searchsorted(np.degrees(colatitudes(resolution)), region.colatitude)
    around, count = np.degrees(azimuths(resolution)), 2 * resolution
    turns = np.concatenate([around - 360, around, around + 360])
    left, right = np.searchsorted(turns, region.azimuth) - count
    rows = slice(int(top), int(bottom))
    if left >= 0 and right <= count:
        return rows, slice(int(left), int(right))
    return rows, np.arange(left, right) % count


def directions(colatitude: Floats, azimuth: Floats) -> Floats:
    """Return points of the parametric unit sphere, shape (..., 3): y is the pole, azimuth runs from x to z."""
    s = np.sin(colatitude)
    return np.stack(np.broadcast_arrays(s * np.cos(azimuth), np.cos(colatitude), s * np.sin(azimuth)), axis=-1)


@lru_cache(maxsize=8)
def closed_lattice(n: int) -> Ints:
    """Return the triangles (4 n^2, 3) of the lattice of n colatitudes; vertices 2 n^2 and 2 n^2 + 1 are the poles.

    Quads are cut as the file formats cut them. Counter-clockwise as seen from outside.
    """
    here = np.arange(2 * n * n).reshape(n, 2 * n)
    right = np.roll(here, -1, axis=1)
    quads = np.stack([right[:-1], right[1:], here[1:], here[:-1]], axis=-1).reshape(-1, 4)
    north, south = np.full(2 * n, 2 * n * n), np.full(2 * n, 2 * n * n + 1)
    fans = np.concatenate([np.stack([north, right[0], here[0]], 1), np.stack([south, here[-1], right[-1]], 1)])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], fans])
    triangles.flags.writeable = False
    return triangles
