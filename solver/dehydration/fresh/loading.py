"""How the flesh shrinks from place to place: Fd as a field over the fresh sarcocarp.

Liu et al. 2014, Eq. 1: F = Fe Fd; section 3.1 allows Fd to be a field and anisotropic. Light, humidity and pressure
enter through it: local shrinkage s (1 - g . X), Fd = diag(1 - a_i s (1 - g . X)). Energy per fresh volume is
det(Fd) W(F Fd^-1). Light dries as long as it shines: theta = 1 / (1 + k E) is inversely proportional to the
illumination E that the flesh has had, and k = s / (1 - s) makes it 1 - s where E = 1.

A fruit without a stone has a ball cut out around its centre, whose surface is led along by x = Fd(0) X: what the flesh
does there if nothing but hydrostatic pressure reaches the centre, as in a smooth sphere.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import InvalidInput
from ...fruit import lattice
from ...lattice import directions
from ...rounding import towards_zero
from ..params import DehydrationParams

__all__ = ["Loading"]


#: Bounds of the diagonal of Fd: flesh shrunk further has no volume left, swollen further leaves the kernel's range.
LEAST, MOST = 0.05, 2.5
#: Farthest place from the centre that a swollen fruit may reach, in units of r1 (the kernel's fixed point holds 3.9).
FARTHEST = 3.6
#: Least factor of the local shrinkage that pace and start are measured by.
_SLOWEST = 0.05
_GRID = lattice(32)
_AROUND = directions(*lattice(64)).reshape(-1, 3)


class Loading:
    """Fd over the fresh flesh of one fruit, at any shrinkage s of the stage axis (negative: swelling).

    uniform: Fd = (1 - s) I everywhere. peak: largest local shrinkage over s, 1 if uniform.
    """

    def __init__(self, params: DehydrationParams) -> None:
        self._params = params
        self._gradient = np.asarray(params.wetness, dtype=float)
        self._factors = np.asarray(params.anisotropy, dtype=float)
        self.uniform: bool = params.dries_evenly
        self._share = params.local_share
        lit = params.illumination(_AROUND) if params.is_lit else np.ones(1)
        self._centre, self._brightest = float(lit.mean()), float(lit.max())
        # light dries fastest at first
        fastest = self._factors.max() * self._share[1] * self._brightest
        self.peak: float = 1.0 if self.uniform else max(fastest, _SLOWEST)
        self._size = float(np.linalg.norm(params.sarcocarp(*_GRID), axis=-1).max()) + params.exocarp_thickness
        self._has_stone = params.has_stone

    def local(self, points: Floats, shrinkage: float) -> Floats:
        """Return the local shrinkage (n,) at fresh points (n, 3) in units of r1: s (1 - g . X), s as it is lit."""
        even = _lit(self._params.illumination(points), shrinkage) if self._params.is_lit else shrinkage
        # not `@`: BLAS rounds differently with another number of threads
        found: Floats = even * (1 - np.einsum("ni,i->n", points, self._gradient))
        return found

    def fd(self, points: Floats, shrinkage: float) -> Floats:
        """Return the diagonal of Fd, shape (n, 3), at fresh points (n, 3) of the flesh."""
        found: Floats = 1 - self.local(points, shrinkage)[:, None] * self._factors
        return found

    def held(self, points: Floats, shrinkage: float) -> Floats:
        """Return where the inner nodes are, (n, 3), from their fresh places (n, 3): they stay on a stone, or follow."""
        if self._has_stone:
            return points
        # the ball's surface as one, and lit as the fruit is in the mean
        return points * (1 - _lit(self._centre, shrinkage) * self._factors)

    def check(self, shrinkage: float) -> None:
        """Refuse a stage at which some flesh would be gone, or swollen out of range.

        Raises:
            InvalidInput: with the shrinkage up to which this loading can go.

        """
        if shrinkage < 0 and self._params.is_lit:
            raise InvalidInput(
                f"at s = {shrinkage:g} the fruit swells, and light dries it.",
                advice="Leave out light and light_map, or ask for stages from 0.",
            )
        factor, bright = float(self._factors.max()), self._brightest
        low = 1 - factor * self._share[1] * _lit(bright, max(shrinkage, 0))
        high = 1 - factor * self._share[1] * min(shrinkage, 0)
        if low <= LEAST:
            most = (1 - LEAST) / (factor * self._share[1])
            raise InvalidInput(
                f"at s = {shrinkage:g} the driest flesh would have shrunk by {1 - low:.2f} (at most {1 - LEAST:.2f}).",
                advice=f"Ask for stages below {towards_zero(most / (bright - most * bright + most))}, or for less "
                "wetness, anisotropy or light.",
            )
        most = min(MOST, FARTHEST / self._size)
        if high > most:
            raise InvalidInput(
                f"at s = {shrinkage:g} the flesh would have swollen to {high:.2f} times its size (at most {most:.2f}).",
                advice=f"Ask for stages above {towards_zero((1 - most) / (factor * self._share[1]))}, or for less "
                "wetness or anisotropy.",
            )


def _lit(illumination: Floats | float, shrinkage: float) -> Floats | float:
    """Return the shrinkage 1 - theta under an illumination, `shrinkage` where that is 1."""
    if isinstance(illumination, float) and illumination == 1.0:
        return shrinkage
    return shrinkage * illumination / (1 - shrinkage + shrinkage * illumination)
