"""How much of a place a mesh sees: a share is known at its vertices, and even between them.

What lies between all vertices acts nowhere. What varies within triangles is lost or comes out as another pattern:
`lost` is the root of the mean square, over the surface, of what the vertices make of a share less what it is, over its
standard deviation: .04 of waves of eight edges, .16 of four, .27 of three, .55 of two, 1 and more of finer ones.
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ..shapes import Ground
from .places import Harmonic, Lines, Painted, Place, Reaction, Texture, share
from .textures import laid, laid_within

__all__ = ["Seen", "seen"]

#: Triangles that are looked into at most, spread over the surface, and points in each: thirds of its three kites.
_LOOKED_INTO = 4000
_WITHIN = np.array([*sorted(permutations((2 / 3, 1 / 4, 1 / 12))), (1 / 3, 1 / 3, 1 / 3)])
#: Pairs of points and pieces of lines beyond which looking would be work of its own.
_PAIRS = 30_000_000
#: Cells to a wave of Gray and Scott's patterns, about.
_WAVE = 10.0


class Seen(NamedTuple):
    """most: largest share of any vertex [1]. lost: what varies within triangles (above) [1]."""

    most: float
    lost: float


def seen(place: Place, ground: Ground, seed: int) -> Seen | None:
    """Return what the vertices of a surface see of a place; None where to tell would take long.

    Raises:
        InvalidInput: a place that the shape does not have.

    """
    mesh = ground.mesh
    some = np.arange(0, len(mesh.triangles), -(-len(mesh.triangles) // _LOOKED_INTO))
    if isinstance(place, Harmonic):
        return None
    if isinstance(place, Lines):
        pieces = sum(len(line) - 1 for line in place.lines)
        if pieces * (len(mesh.x) + len(some) * len(_WITHIN)) > _PAIRS:
            return None
    if isinstance(place, Reaction):
        # as fine as its patterns, which take long to come about
        turns = 2 * np.pi / _WAVE * np.arange(place.size)
        texture = 0.5 + 0.5 * np.outer(np.sin(turns), np.sin(turns))
        there = laid(texture, ground, place.projection)
        within = laid_within(texture, ground, place.projection, some, _WITHIN)
    else:
        there = share(place, ground, seed)
        if isinstance(place, Painted):
            return Seen(float(there.max()), 0.0)
        if isinstance(place, Texture):
            within = np.clip(laid_within(place.grid, ground, place.projection, some, _WITHIN), 0, 1)
        else:
            points = (_WITHIN @ mesh.x[mesh.triangles[some]]).reshape(-1, 3)
            within = share(place, ground, seed, points).reshape(len(some), -1)
    return Seen(float(there.max()), _lost(there[mesh.triangles[some]] @ _WITHIN.T, within, _areas(ground, some)))


def _areas(ground: Ground, some: Ints) -> Floats:
    p = ground.mesh.x[ground.mesh.triangles[some]]
    found = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return np.asarray(found / found.sum())


def _lost(even: Floats, within: Floats, areas: Floats) -> float:
    varies = float(areas @ ((within - areas @ within.mean(axis=1)) ** 2).mean(axis=1))
    missed = float(areas @ ((even - within) ** 2).mean(axis=1))
    # of what is the same everywhere nothing is missed but roundings
    return float(np.sqrt(missed / max(varies, 1e-12)))
