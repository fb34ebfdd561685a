"""The closed lattice as Blender wants it: flat lists of corners, and turned so that z is up."""

from __future__ import annotations

from array import array
from functools import lru_cache

__all__ = ["quads", "upright"]


@lru_cache(maxsize=8)
def quads(n: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the corners of all faces in a row, and how many each face has: quads, and triangles around the poles.

    Vertices are n rows of 2n, from the pole at the top, then the two poles; faces turn counter-clockwise from outside.
    """
    wide, corners, counts = 2 * n, list[int](), list[int]()
    north, south = n * wide, n * wide + 1
    for j in range(wide):
        k = (j + 1) % wide
        corners += (north, k, j)
        counts.append(3)
    for i in range(n - 1):
        for j in range(wide):
            k = (j + 1) % wide
            a, b = i * wide, (i + 1) * wide
            corners += (a + j, a + k, b + k, b + j)
            counts.append(4)
    last = (n - 1) * wide
    for j in range(wide):
        k = (j + 1) % wide
        corners += (south, last + j, last + k)
        counts.append(3)
    return tuple(corners), tuple(counts)


def upright(positions: array[float]) -> array[float]:
    """Return positions x, y, z in a row with z up where y was: (x, y, z) becomes (x, -z, y)."""
    found = array("f", positions)
    found[1::3] = array("f", [-z for z in positions[2::3]])
    found[2::3] = positions[1::3]
    return found
