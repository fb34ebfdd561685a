"""How far a surface passes through itself, on the triangles that are handed over; shares nothing with contact."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Ints
from ...geometry.crossings import Crossings, crossings, split_quads
from ...lattice import closed_lattice

__all__ = ["of_lattice", "of_quads"]


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
