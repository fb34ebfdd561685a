"""The hex27 element on the cube [-1, 1]^3: triquadratic shape functions, 3x3x3 Gauss rule, trilinear pressure.

Local node a = 9 i + 3 j + k sits at (xi, eta, zeta) = (i, j, k) - 1; zeta is radial. The pressure of an element is
trilinear in the local coordinates and independent of its neighbours'. With a merely linear one (P-1) the volume of
the skin's bending waves is left free: with 8 elements per edge a sphere's onset came out 13 % low, now 3 % high.
The trilinear pressure is not inf-sup stable in general; the tests show displacements unharmed up to kappa/mu = 1e6.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats

__all__ = [
    "NODES",
    "POINTS",
    "PRESSURE",
    "SHAPE_GRADIENTS",
    "WEIGHTS",
    "pressure_functions",
    "shape",
    "shape_gradients",
]


def _parabolas(t: Floats) -> tuple[Floats, Floats]:
    """Values and slopes (..., 3) of the parabolas that are 1 at -1, 0 and 1."""
    values = np.stack([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2], axis=-1)
    slopes = np.stack([t - 0.5, -2 * t, t + 0.5], axis=-1)
    return values, slopes


def shape(points: Floats) -> Floats:
    """Return the 27 shape functions at local points (q, 3): (q, 27)."""
    (a, _), (b, _), (c, _) = (_parabolas(points[:, k]) for k in range(3))
    return np.einsum("qi,qj,qk->qijk", a, b, c).reshape(len(points), 27)


def shape_gradients(points: Floats) -> Floats:
    """Return the derivatives of the shape functions by the local coordinates at (q, 3): (q, 27, 3)."""
    (a, da), (b, db), (c, dc) = (_parabolas(points[:, k]) for k in range(3))
    parts = [(da, b, c), (a, db, c), (a, b, dc)]
    return np.stack([np.einsum("qi,qj,qk->qijk", *p).reshape(len(points), 27) for p in parts], axis=-1)


def pressure_functions(points: Floats) -> Floats:
    """Return 1, xi, eta, zeta, their products in pairs and in all at local points (q, 3): (q, 8)."""
    x, y, z = points.T
    return np.stack([np.ones_like(x), x, y, z, x * y, y * z, x * z, x * y * z], axis=-1)


def _rule() -> tuple[Floats, Floats]:
    at, weight = np.polynomial.legendre.leggauss(3)
    points = np.stack(np.meshgrid(at, at, at, indexing="ij"), axis=-1).reshape(27, 3)
    return points, np.einsum("i,j,k->ijk", weight, weight, weight).ravel()


#: Local coordinates of the nodes, (27, 3).
NODES: Floats = np.stack(np.meshgrid(*[np.array([-1.0, 0.0, 1.0])] * 3, indexing="ij"), axis=-1).reshape(27, 3)
#: Gauss points (27, 3) and weights (27,).
POINTS, WEIGHTS = _rule()
#: Derivatives of the shape functions at the Gauss points, (27, 27, 3).
SHAPE_GRADIENTS: Floats = shape_gradients(POINTS)
#: The eight pressure functions at the Gauss points, (27, 8).
PRESSURE: Floats = pressure_functions(POINTS)
