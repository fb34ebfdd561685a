"""The closed lattice as Blender wants it: flat lists of corners, and turned so that z is up."""

from __future__ import annotations

from array import array
from functools import lru_cache

__all__ = ["triangles", "upright"]


@lru_cache(maxsize=8)
def triangles(n: int) -> tuple[int, ...]:
    """Return the corners of all triangles in a row, three each, counter-clockwise from outside.

    Vertices are n rows of 2n, from the pole at the top, then the two poles. Not quads: Blender would cut them along
    the other diagonal, along which a folded shape crosses itself.
    """
    wide, corners = 2 * n, list[int]()
    north, south = n * wide, n * wide + 1
    for j in range(wide):
        corners += (north, (j + 1) % wide, j)
    for i in range(n - 1):
        for j in range(wide):
            k = (j + 1) % wide
            a, b = i * wide, (i + 1) * wide
            corners += (a + j, a + k, b + j, a + k, b + k, b + j)
    last = (n - 1) * wide
    for j in range(wide):
        corners += (south, last + j, last + (j + 1) % wide)
    return tuple(corners)


def upright(positions: array[float]) -> array[float]:
    """Return positions x, y, z in a row with z up where y was: (x, y, z) becomes (x, -z, y)."""
    found = array("f", positions)
    found[1::3] = array("f", [-z for z in positions[2::3]])
    found[2::3] = positions[1::3]
    return found
