"""Reference elements and quadrature, from scikit-fem: what every road of finite elements here starts from.

Segments, quadrilaterals and hexahedra live on [-1, 1]^d (scikit-fem's on [0, 1]^d), their nodes run like the indices of
a C-ordered array: the last coordinate fastest. They are tensor products of scikit-fem's segments: its own triquadratic
hexahedron is written out in powers, which rounds ten times worse (2e-15) and costs more to evaluate, and its order of
nodes is another. A function of a node left of the middle is taken as the mirror image of the one on the right, so that
what is symmetric is so to the last bit.

scikit-fem is imported when the first table is asked for: parameters, schemas and the service need none. Its assembler
is not used: on meshes like ours the compiled kernels are some hundred times faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from .arrays import Floats

__all__ = ["HEX8", "HEX27", "QUAD9", "Box", "gauss", "lobatto", "segment", "tetrahedron_gradients"]

#: scikit-fem's interval and ours have the same middle; an interval of ours is twice as long.
_LENGTH = 2.0


def gauss(count: int, dimensions: int = 1) -> tuple[Floats, Floats]:
    """Return Gauss' rule with `count` points each way on [-1, 1]^d: points (count^d, d) and weights (count^d,).

    It is exact for polynomials of degree 2 count - 1 in each coordinate. Raises ValueError for fewer than two points,
    which scikit-fem has no rule for.
    """
    if count < 2:
        raise ValueError("a rule has at least two points each way")
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefLine

    at, weight = get_quadrature(RefLine, 2 * count - 1)
    along, share = _LENGTH * at[0] - 1, _LENGTH * weight
    points, weights = along[:, None], share
    for _ in range(dimensions - 1):
        inner = np.tile(along, len(points))[:, None]
        points = np.concatenate([np.repeat(points, count, axis=0), inner], axis=1)
        weights = np.outer(weights, share).ravel()
    return points, weights


def lobatto(order: int) -> Floats:
    """Return the nodes (order + 1,) of a segment: both ends and where Legendre's polynomial of `order` is level."""
    inside = np.sort(legendre.legroots(legendre.legder([0] * order + [1]))) if order > 1 else np.empty(0)
    nodes = np.concatenate([[-1.0], inside, [1.0]])
    return np.asarray((nodes - nodes[::-1]) / 2)


def segment(order: int, at: Floats) -> tuple[Floats, Floats]:
    """Return values and slopes (..., order + 1) at `at` (...) of the polynomials that are 1 at one of the nodes."""
    values, slopes = _functions(order, at)
    mirrored, turned = _functions(order, -at)
    left = (order + 1) // 2
    values[..., :left] = mirrored[..., ::-1][..., :left]
    slopes[..., :left] = -turned[..., ::-1][..., :left]
    return values, slopes


def _functions(order: int, at: Floats) -> tuple[Floats, Floats]:
    values, slopes = _hierarchy(order, at)
    if order <= 2:  # scikit-fem numbers both ends first
        rank = [0, *range(2, order + 1), 1]
        return values[..., rank], slopes[..., rank]
    nodal = np.linalg.inv(_hierarchy(order, lobatto(order))[0])
    return values @ nodal, slopes @ nodal


def _hierarchy(order: int, at: Floats) -> tuple[Floats, Floats]:
    """Return values and slopes (..., order + 1) of scikit-fem's functions on a segment, in its own order."""
    from skfem.element import ElementLineP1, ElementLineP2, ElementLinePp

    element = ElementLineP1() if order == 1 else ElementLineP2() if order == 2 else ElementLinePp(order)
    where = (1 + np.asarray(at, dtype=float).ravel()[None]) / _LENGTH
    both = [element.lbasis(where, k) for k in range(order + 1)]
    shape = (*np.shape(at), order + 1)
    values = np.stack([np.broadcast_to(value, where.shape[1:]) for value, _ in both], axis=-1)
    slopes = np.stack([np.broadcast_to(slope[0], where.shape[1:]) for _, slope in both], axis=-1) / _LENGTH
    return values.reshape(shape), slopes.reshape(shape)


@dataclass(frozen=True)
class Box:
    """The Lagrange element of `order` on [-1, 1]^dimensions, the last coordinate of its nodes running fastest."""

    order: int
    dimensions: int

    @property
    def nodes(self) -> Floats:
        """Local coordinates of the nodes, (n, d)."""
        axes = np.meshgrid(*[lobatto(self.order)] * self.dimensions, indexing="ij")
        return np.stack(axes, axis=-1).reshape(-1, self.dimensions)

    def shape(self, points: Floats) -> Floats:
        """Return the shape functions at local points (q, d): (q, n)."""
        return self._product([segment(self.order, at)[0] for at in points.T])

    def gradients(self, points: Floats) -> Floats:
        """Return the derivatives of the shape functions by the local coordinates at (q, d): (q, n, d)."""
        both = [segment(self.order, at) for at in points.T]
        parts = [[pair[own == axis] for own, pair in enumerate(both)] for axis in range(self.dimensions)]
        return np.stack([self._product(part) for part in parts], axis=-1)

    def _product(self, factors: list[Floats]) -> Floats:
        out = factors[0]
        for factor in factors[1:]:
            out = (out[:, :, None] * factor[:, None, :]).reshape(len(out), -1)
        return out


#: Trilinear and triquadratic hexahedron, biquadratic quadrilateral.
HEX8, HEX27, QUAD9 = Box(1, 3), Box(2, 3), Box(2, 2)


def tetrahedron_gradients() -> Floats:
    """Return the derivatives (4, 3) of the linear functions on the corner of the unit cube at the origin."""
    from skfem.element import ElementTetP1

    centre = np.full((3, 1), 0.25)
    return np.stack([np.asarray(ElementTetP1().lbasis(centre, k)[1], dtype=float).reshape(3) for k in range(4)])
