"""Newton's method with exact second derivatives: it takes over where a thin sheet keeps quasi-Newton steps short.

A thin sheet is stiff within its surface and soft across it, by (l/h)^2, and its compressed parts have negative
curvature until they have buckled far enough. The second derivative is shifted by tau until its factor has no negative
pivot (Sylvester's law of inertia), as little as that takes; tau falls again where steps are taken whole. So steps lead
down, and at the end they are Newton's own, which converge quadratically.

A shifted step may end on a saddle, where nothing pushes either: `bending` tells it from a minimum, and steps off it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, Protocol, TypeAlias

import numpy as np
from scipy.linalg import qr
from scipy.sparse import bsr_array

from ...arrays import Floats, Ints
from ...linalg.definite import Factor, factorise
from ...linalg.multifrontal import Analysis
from .minimise import Energy, Point, descend, longest

__all__ = ["ASIDE", "Bends", "Curved", "bending", "newton"]

#: How the energy bends where nothing pushes: up along every way, down along one, or as its digits do not tell.
Bends: TypeAlias = Literal["up", "down", "flat"]

#: First and largest shift [mu], and the factors by which it rises and falls.
_FIRST, _LARGEST, _RISE, _FALL = 1e-8, 1e2, 8.0, 0.125
#: What rigid motions are pinned by [mu].
_PIN = 1.0
#: Iterations to the way along which the energy bends down most, and the change of its curvature that ends them.
_ITERATIONS, _SAME = 60, 0.01
#: How far a vertex is moved at most off a saddle, over the mean rest edge.
ASIDE = 0.1
#: A step off a saddle is halved so often; share of the drop that must come; digits that are rounding.
_HALVINGS, _SHARE, _DIGITS = 12, 0.25, 100 * np.finfo(float).eps
#: Slope that decides on which side of a saddle a shape leaves it, over what its curvature makes of the step.
_SIDE = 1e-4


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
    shift, left = 0.0, np.inf
    while True:
        size = longest(g)
        # without a force there is no step, whichever way the energy bends
        yield Point(x, f, size, stuck=size == 0.0, left=left)
        if size == 0.0:
            return
        matrix, rigid, order = energy.hessian(x), energy.rigid(x), energy.analysis(x)
        t, d = 0.0, g
        while t == 0.0:
            found = _direction(order, _definite(matrix, energy.diagonal, rigid, shift), g)
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
        stays, left = value == f, np.inf if shift else longest(d)
        x, f, g = x + t * d, value, gradient
        if t == 1.0:
            shift = shift * _FALL if shift > _FIRST else 0.0
        if stays and longest(g) >= size:
            yield Point(x, f, longest(g), stuck=True, left=left)
            return


def bending(energy: Curved, x: Floats, start: Floats, step: float) -> tuple[Bends, Floats]:
    """Tell how the energy bends at x (n, 3), and where to go on: x, or where the energy is lower if it bends down.

    start (n, 3): where the search for the way down begins. step: largest move of a vertex.
    """
    matrix, rigid, order = energy.hessian(x), energy.rigid(x), energy.analysis(x)
    shift, factor = 0.0, _factor(order, _definite(matrix, energy.diagonal, rigid, 0.0))
    if factor is not None:
        return "up", x
    while factor is None:
        shift = max(_FIRST, _RISE * shift)
        factor = _factor(order, _shifted(matrix.data, energy.diagonal, shift))
    way, curvature = _lowest(matrix, factor, rigid, start)
    f, g = energy(x)
    t = step / longest(way)
    # where what is left of the forces is rounding, the start says which side it is
    if float(np.vdot(g, way)) > -_SIDE * t * curvature:
        way = -way
    t = energy.allowed(x, way, t)
    for _ in range(_HALVINGS):
        drop = -0.5 * t * t * curvature
        if drop <= _DIGITS * abs(f):
            break
        if energy(x + t * way)[0] <= f - _SHARE * drop:
            return "down", x + t * way
        t /= 2
    return "flat", x


def _lowest(matrix: bsr_array, factor: Factor, rigid: Floats, start: Floats) -> tuple[Floats, float]:
    """Return the way (n, 3) of length 1 along which the matrix is least, beside rigid motions, and how much it is.

    By inverse iteration with the factor of the shifted matrix: where several ways are negative, any of them will do.
    """
    way, curvature = start.ravel(), np.inf
    for _ in range(_ITERATIONS):
        way = factor.solve(way)
        way = way - rigid @ (way @ rigid)
        way = way / np.linalg.norm(way)
        last, curvature = curvature, float(way @ (matrix @ way))
        if curvature < 0 and abs(curvature - last) <= _SAME * abs(curvature):
            break
    return way.reshape(-1, 3), curvature


def _definite(matrix: bsr_array, diagonal: Ints, rigid: Floats, shift: float) -> Floats:
    """Return the blocks (nnz, 3, 3) of matrix + shift; of the matrix itself with its rigid motions pinned.

    Along those it is rounding, which may have any sign. As many coordinates are pinned as there are such motions, so
    that nothing else is: the step is Newton's own, and a way along which the energy bends down still shows.
    """
    if shift or not rigid.shape[1]:
        return _shifted(matrix.data, diagonal, shift)
    found = matrix.data.copy()
    pinned = qr(rigid.T, mode="r", pivoting=True)[1][: rigid.shape[1]]
    found[diagonal[pinned // 3], pinned % 3, pinned % 3] += _PIN
    return found


def _shifted(blocks: Floats, diagonal: Ints, shift: float) -> Floats:
    """Return the blocks (nnz, 3, 3) of matrix + shift."""
    if not shift:
        return blocks
    found = blocks.copy()
    found[diagonal] += shift * np.eye(3)
    return found


def _factor(order: Analysis, blocks: Floats) -> Factor | None:
    try:
        return factorise(order, blocks)
    except np.linalg.LinAlgError:
        return None


def _direction(order: Analysis, blocks: Floats, gradient: Floats) -> Floats | None:
    """Return -matrix^-1 gradient (n, 3), or None where the matrix is not positive definite."""
    factor = _factor(order, blocks)
    if factor is None:
        return None
    found: Floats = -factor.solve(gradient.ravel()).reshape(-1, 3)
    return found
