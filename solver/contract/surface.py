"""The fresh shape X(q) of a solver whose surface is parametric: what the floors above need to build tables of shapes.

The surface lives on the parametric sphere: colatitude from the pole y > 0, azimuth about y from x towards z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, Floats
from ..lattice import azimuths, colatitudes

__all__ = ["Extent", "Fresh", "Surface"]


class Extent(NamedTuple):
    """The box that a thing fills before its run: lengths (3) of its sides, y up, in the solver's unit of length.

    metres: of that unit; None where nobody knows.
    """

    sides: Floats
    metres: float | None = None


class Fresh:
    """A fresh shape. `points` is all that one must give; the rest follows from it, or is given where that is faster."""

    def points(self, colatitude: Array, azimuth: Array) -> Array:
        """Return points (..., 3) at colatitude and azimuth [radian] (...), in the solver's unit of length."""
        raise NotImplementedError

    def planes(
        self, n: int, rows: slice, columns: slice | Array, components: tuple[int, ...], kind: np.dtype[Any]
    ) -> Iterator[Array]:
        """Yield the components of a part of the lattice of `n` colatitudes, each broadcasting to (height, width).

        kind: the precision of what is yielded.
        """
        points = self.points(*np.meshgrid(colatitudes(n)[rows], azimuths(n)[columns], indexing="ij")).astype(kind)
        for component in components:
            yield points[..., component]

    def poles(self) -> Array:
        """Return the two poles (2, 3)."""
        return self.points(np.array([0.0, np.pi]), np.zeros(2))

    def core(self, rays: Array) -> Array | None:
        """Return how far a rigid core reaches from the centre along unit rays (..., 3); None without one."""
        return None


@dataclass(frozen=True)
class Surface:
    """The fresh shapes of a solver: `of` makes one of the parameters in `fields`, the only ones that it depends on.

    `of` is given those fields by name, as plain values, and raises `InvalidGeometry` where no shape has them.
    """

    fields: tuple[str, ...]
    of: Callable[[Mapping[str, Any]], Fresh]
