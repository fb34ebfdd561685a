"""Newton's method with exact second derivatives: it takes over where a thin sheet keeps quasi-Newton steps short.

A thin sheet is stiff within its surface and soft across it, by (l/h)^2, and its compressed parts have negative
curvature until they have buckled far enough. The second derivative is shifted by tau until its factor has no negative
pivot (Sylvester's law of inertia), as little as that takes; tau falls again where steps are taken whole. So steps lead
down, and at the end they are Newton's own, which converge quadratically.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from ...arrays import Floats
from .minimise import Energy, Point, descend

__all__ = ["Curved", "newton"]

#: First and largest shift [mu], and the factors by which it rises and falls.
_FIRST, _LARGEST, _RISE, _FALL = 1e-8, 1e2, 8.0, 0.125


class Curved(Energy, Protocol):
    """An energy with second derivatives."""

    def hessian(self, x: Floats) -> csc_array:
        """Return the second derivative (3n, 3n), rows and columns of what is held those of the unit matrix."""

    def rigid(self, x: Floats) -> Floats:
        """Return an orthonormal basis (3n, k) of motions that change no energy."""


def newton(energy: Curved, x: Floats) -> Iterator[Point]:
    """Go down from x (n, 3); yields before the first step and after every one."""
    f, g = energy(x)
    shift = 0.0
    while True:
        size = float(np.abs(g).max())
        yield Point(x, f, size)
        if size == 0.0:
            return
        matrix, rigid = energy.hessian(x), energy.rigid(x)
        t, d = 0.0, g
        while t == 0.0:
            found = _direction(matrix, g, shift)
            if found is not None:
                # along these the matrix is rounding, and so is what it divides by
                d = found - (rigid @ (found.ravel() @ rigid)).reshape(-1, 3)
                t, value, gradient = descend(energy, x, f, d, float(np.vdot(g, d)))
            if t == 0.0:
                shift = max(_FIRST, _RISE * shift)
                if shift > _LARGEST:
                    yield Point(x, f, size, stuck=True)
                    return
        stays = value == f
        x, f, g = x + t * d, value, gradient
        if t == 1.0:
            shift = shift * _FALL if shift > _FIRST else 0.0
        if stays and float(np.abs(g).max()) >= size:
            yield Point(x, f, float(np.abs(g).max()), stuck=True)
            return


def _direction(matrix: csc_array, gradient: Floats, shift: float) -> Floats | None:
    """Return -(matrix + shift)^-1 gradient (n, 3), or None where that matrix is not positive definite."""
    shifted = csc_array(matrix + shift * eye_array(gradient.size, format="csc", dtype=np.float64)) if shift else matrix
    try:
        # pivots from the diagonal only: then those of U have the signs of the eigenvalues
        factor = splu(
            shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
        )
    except RuntimeError:
        return None
    if not np.array_equal(factor.perm_r, factor.perm_c) or (factor.U.diagonal() <= 0).any():
        return None
    found: Floats = -factor.solve(gradient.ravel()).reshape(-1, 3)
    return found
