"""How the flesh shrinks from place to place: Fd as a field over the fresh sarcocarp.

Liu et al. 2014, Eq. 1: F = Fe Fd; section 3.1 allows Fd to be a field and anisotropic. Light, humidity and pressure
enter through it: local shrinkage s (1 - g . X), Fd = diag(1 - a_i s (1 - g . X)). Energy per fresh volume is
det(Fd) W(F Fd^-1).

A fruit without a stone has a ball cut out around its centre, whose surface is led along by x = Fd(0) X: what the flesh
does there if nothing but hydrostatic pressure reaches the centre, as in a smooth sphere.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import InvalidInput
from ...fruit import lattice
from ..params import DehydrationParams

__all__ = ["Loading"]


#: Bounds of the diagonal of Fd: flesh shrunk further has no volume left, swollen further leaves the kernel's range.
LEAST, MOST = 0.05, 2.5
#: Farthest place from the centre that a swollen fruit may reach, in units of r1 (the kernel's fixed point holds 3.9).
FARTHEST = 3.6
#: Least factor of the local shrinkage that pace and start are measured by.
_SLOWEST = 0.05
_GRID = lattice(32)


class Loading:
    """Fd over the fresh flesh of one fruit, at any shrinkage s of the stage axis (negative: swelling).

    uniform: Fd = (1 - s) I everywhere. peak: largest local shrinkage over s, 1 if uniform.
    """

    def __init__(self, params: DehydrationParams) -> None:
        self._gradient = np.asarray(params.wetness, dtype=float)
        self._factors = np.asarray(params.anisotropy, dtype=float)
        self.uniform: bool = not self._gradient.any() and bool((self._factors == 1).all())
        self._share = params.local_share
        self.peak: float = 1.0 if self.uniform else max(self._factors.max() * self._share[1], _SLOWEST)
        self._size = float(np.linalg.norm(params.sarcocarp(*_GRID), axis=-1).max()) + params.exocarp_thickness
        self._has_stone = params.has_stone

    def local(self, points: Floats, shrinkage: float) -> Floats:
        """Return the local shrinkage s (1 - g . X), shape (n,), at fresh points (n, 3) in units of r1."""
        # not `@`: BLAS rounds differently with another number of threads
        found: Floats = shrinkage * (1 - np.einsum("ni,i->n", points, self._gradient))
        return found

    def fd(self, points: Floats, shrinkage: float) -> Floats:
        """Return the diagonal of Fd, shape (n, 3), at fresh points (n, 3) of the flesh."""
        found: Floats = 1 - self.local(points, shrinkage)[:, None] * self._factors
        return found

    def held(self, points: Floats, shrinkage: float) -> Floats:
        """Return where the inner nodes are, (n, 3), from their fresh places (n, 3): they stay on a stone, or follow."""
        if self._has_stone:
            return points
        return points * self.fd(np.zeros((1, 3)), shrinkage)

    def check(self, shrinkage: float) -> None:
        """Refuse a stage at which some flesh would be gone, or swollen out of range.

        Raises:
            InvalidInput: with the shrinkage up to which this loading can go.

        """
        factor = float(self._factors.max())
        low, high = 1 - factor * self._share[1] * max(shrinkage, 0), 1 - factor * self._share[1] * min(shrinkage, 0)
        if low <= LEAST:
            raise InvalidInput(
                f"at s = {shrinkage:g} the driest flesh would have shrunk by {1 - low:.2f} (at most {1 - LEAST:.2f}).",
                advice=f"Ask for stages below {(1 - LEAST) / (factor * self._share[1]):.3g}, or for less wetness "
                "or anisotropy.",
            )
        most = min(MOST, FARTHEST / self._size)
        if high > most:
            raise InvalidInput(
                f"at s = {shrinkage:g} the flesh would have swollen to {high:.2f} times its size (at most {most:.2f}).",
                advice=f"Ask for stages above {(1 - most) / (factor * self._share[1]):.3g}, or for less wetness "
                "or anisotropy.",
            )
