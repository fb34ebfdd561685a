"""How far a surface passes through itself, on the triangles that are handed over; shares nothing with contact."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...arrays import Floats, Ints
from ...geometry.crossings import Crossings, crossings, split_quads

__all__ = ["closed_lattice", "of_lattice", "of_quads"]


def of_quads(nodes: Floats, quads: Ints) -> Crossings:
    """Crossings of a surface of quads (nq, 4) on nodes (nc, 3), each cut from its first corner to its third."""
    return crossings(nodes, split_quads(quads))


def of_lattice(positions: Floats) -> Crossings:
    """Crossings of a surface on the lattice (n, 2n, 3), closed at the poles by the means of the first and last ring.

    Its triangles are those that the file formats write.
    """
    n = len(positions)
    poles = positions[[0, -1]].mean(axis=1)
    return crossings(np.concatenate([positions.reshape(-1, 3), poles]), closed_lattice(n))


@lru_cache(maxsize=8)
def closed_lattice(n: int) -> Ints:
    """Return the triangles (4 n^2, 3) of the lattice of n colatitudes; vertices 2 n^2 and 2 n^2 + 1 are the poles."""
    here = np.arange(2 * n * n).reshape(n, 2 * n)
    right = np.roll(here, -1, axis=1)
    quads = np.stack([right[:-1], right[1:], here[1:], here[:-1]], axis=-1).reshape(-1, 4)
    north, south = np.full(2 * n, 2 * n * n), np.full(2 * n, 2 * n * n + 1)
    fans = np.concatenate([np.stack([north, right[0], here[0]], 1), np.stack([south, here[-1], right[-1]], 1)])
    triangles = np.concatenate([split_quads(quads), fans])
    triangles.flags.writeable = False
    return triangles
