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
from scipy.sparse import bsr_array

from ...arrays import Floats, Ints
from ...linalg.definite import factorise
from ...linalg.multifrontal import Analysis
from .minimise import Energy, Point, descend

__all__ = ["Curved", "newton"]

#: First and largest shift [mu], and the factors by which it rises and falls.
_FIRST, _LARGEST, _RISE, _FALL = 1e-8, 1e2, 8.0, 0.125


class Curved(Energy, Protocol):
    """An energy with second derivatives."""

    def hessian(self, x: Floats) -> bsr_array:
        """Return the second derivative (3n, 3n), rows and columns of what is held those of the unit matrix."""

    #: Which blocks of the last second derivative are on the diagonal (n,).
    diagonal: Ints

    def analysis(self, x: Floats) -> Analysis:
        """Return the order in which to eliminate it."""

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
        matrix, rigid, order = energy.hessian(x), energy.rigid(x), energy.analysis(x)
        t, d = 0.0, g
        while t == 0.0:
            found = _direction(order, _shifted(matrix.data, energy.diagonal, shift), g)
            if found is not None:
                # along these the matrix is rounding, and so is what it divides by
                d = found - (rigid @ (found.ravel() @ rigid)).reshape(-1, 3)
                t, value, gradient = descend(energy, x, f, d, float(np.vdot(g, d)))
            if t == 0.0:
                shift = max(_FIRST, _RISE * shift)
                if shift > _LARGEST:
                    yield Point(x, f, size, stuck=True)
                    return
        assert d is not None  # t is not 0
        stays = value == f
        x, f, g = x + t * d, value, gradient
        if t == 1.0:
            shift = shift * _FALL if shift > _FIRST else 0.0
        if stays and float(np.abs(g).max()) >= size:
            yield Point(x, f, float(np.abs(g).max()), stuck=True)
            return


def _shifted(blocks: Floats, diagonal: Ints, shift: float) -> Floats:
    """Return the blocks (nnz, 3, 3) of matrix + shift."""
    if not shift:
        return blocks
    found = blocks.copy()
    found[diagonal] += shift * np.eye(3)
    return found


def _direction(order: Analysis, blocks: Floats, gradient: Floats) -> Floats | None:
    """Return -matrix^-1 gradient (n, 3), or None where the matrix is not positive definite."""
    try:
        factor = factorise(order, blocks)
    except np.linalg.LinAlgError:
        return None
    found: Floats = -factor.solve(gradient.ravel()).reshape(-1, 3)
    return found
