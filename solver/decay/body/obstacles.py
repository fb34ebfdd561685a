"""What a surface rests on: the floor and the neighbours, as a skin feels them, and as what is handed over obeys them.

The body gives way into both by its own law of penalties, its facets lie inside of the round fruit, and a fold reaches
below what it covers. So the skin is pushed out as its equilibrium is found, and the surface that leaves the solver,
after all interpolation, is laid on what it would still be in: by about as much as a facet is flat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints

__all__ = ["Obstacles"]


class Obstacles(NamedTuple):
    """A floor at a height [r1], or None; balls (b, 4): centres and radii [r1]."""

    floor: float | None
    balls: Floats

    @property
    def any(self) -> bool:
        """Whether there is something to rest on."""
        return self.floor is not None or len(self.balls) > 0

    def depths(self, x: Floats) -> list[tuple[Ints, Floats, Floats]]:
        """Return which points (v, 3) are in something: numbers (k), depths (k), unit ways out (k, 3); of each."""
        found = []
        if self.floor is not None:
            inside = np.flatnonzero(x[:, 1] < self.floor)
            way = np.zeros((len(inside), 3))
            way[:, 1] = 1.0
            found.append((inside, self.floor - x[inside, 1], way))
        for *centre, radius in self.balls:
            away = x - np.asarray(centre)
            far = np.linalg.norm(away, axis=1)
            inside = np.flatnonzero(far < radius)
            found.append((inside, radius - far[inside], away[inside] / np.maximum(far[inside], 1e-300)[:, None]))
        return [part for part in found if len(part[0])]

    def laid(self, x: Floats) -> Floats:
        """Return points (v, 3) moved out of everything by the shortest way."""
        moved = x.copy()
        for _ in range(_ROUNDS):
            inside = self.depths(moved)
            if not inside:
                break
            for points, depth, way in inside:
                moved[points] += depth[:, None] * way
        return moved


#: Between a floor and balls a point that leaves one may enter another.
_ROUNDS = 8
