"""Membrane and bending of a large sheet on two threads, to the last bit what they are on one.

A second thread works out what the later hinges exert, and keeps it; this one adds the membrane, the earlier hinges, and
what was kept: in the order in which one thread adds.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints
from ..linalg.abreast import both, two
from .bending import _pull, bending
from .membrane import membrane
from .topology import Topology

__all__ = ["Halves"]

#: Hinges from which on a second thread gains more than its start takes.
_MANY = 30_000
#: Share of the hinges that the first thread does: it has the membrane, and adds what the second keeps.
_OWN = 0.3


class Halves:
    """Energy and gradient of a mesh's stretching and bending."""

    def __init__(self, mesh: Topology) -> None:
        self._mesh = mesh
        # an array of this size takes as long to be had as to be filled
        self._kept: Floats | None = None

    def __call__(
        self, x: Floats, g: Floats, lame: float, thick: Floats | None, rest: Floats, stiffness: Floats, gradient: Floats
    ) -> float:
        """Return the energy and add its gradient (n, 3); arguments as `membrane` and `bending` have them."""
        triangles, hinges = self._mesh.triangles, self._mesh.hinges
        if len(hinges) < _MANY or not two():
            stretched = membrane(x, triangles, g, lame, gradient, thick)
            return float(stretched + bending(x, hinges, rest, stiffness, gradient))
        own = int(_OWN * len(hinges))
        if self._kept is None:
            self._kept = np.empty((len(hinges) - own, 13))
        kept = self._kept

        def here() -> tuple[float, float]:
            stretched = membrane(x, triangles, g, lame, gradient, thick)
            return stretched, bending(x, hinges[:own], rest[:own], stiffness[:own], gradient)

        (stretched, bent), _ = both(here, lambda _: _keep(x, hinges[own:], rest[own:], stiffness[own:], kept))
        return float(stretched + _add(hinges[own:], kept, bent, gradient))


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(x: Floats, hinges: Ints, rest: Floats, stiffness: Floats, kept: Floats) -> None:
    """Write the energy of each hinge and what it adds to the gradient at its four points to `kept` (h, 13)."""
    for t in range(len(hinges)):
        energy, ix, iy, iz, jx, jy, jz, kx, ky, kz, mx, my, mz = _pull(x, hinges, rest, stiffness, t)
        kept[t, 0] = energy
        kept[t, 1], kept[t, 2], kept[t, 3] = ix, iy, iz
        kept[t, 4], kept[t, 5], kept[t, 6] = jx, jy, jz
        kept[t, 7], kept[t, 8], kept[t, 9] = kx, ky, kz
        kept[t, 10], kept[t, 11], kept[t, 12] = mx, my, mz


@njit(cache=True, nogil=True)
def _add(hinges: Ints, kept: Floats, energy: float, gradient: Floats) -> float:
    """Add what was kept to the energy and to the gradient (n, 3)."""
    for t in range(len(hinges)):
        energy += kept[t, 0]
        for corner in range(4):
            at = hinges[t, corner]
            for d in range(3):
                gradient[at, d] += kept[t, 1 + 3 * corner + d]
    return energy
