"""The mixed element on the cube [-1, 1]^3: triquadratic displacement, trilinear pressure, 3x3x3 Gauss rule.

Local node a = 9 i + 3 j + k sits at (xi, eta, zeta) = (i, j, k) - 1; zeta is radial. The pressure of an element is
trilinear in the local coordinates and independent of its neighbours'. With a merely linear one (P-1) the volume of
the skin's bending waves is left free: with 8 elements per edge a sphere's onset came out 13 % low, now 3 % high.
The trilinear pressure is not inf-sup stable in general; the tests show displacements unharmed up to kappa/mu = 1e6.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...fem import HEX27, gauss

__all__ = ["POINTS", "PRESSURE", "SHAPE_GRADIENTS", "WEIGHTS", "pressure_functions"]


def pressure_functions(points: Floats) -> Floats:
    """Return 1, xi, eta, zeta, their products in pairs and in all at local points (q, 3): (q, 8)."""
    x, y, z = points.T
    return np.stack([np.ones_like(x), x, y, z, x * y, y * z, x * z, x * y * z], axis=-1)


#: Gauss points (27, 3) and weights (27,).
POINTS, WEIGHTS = gauss(3, 3)
#: Derivatives of the shape functions at the Gauss points, (27, 27, 3).
SHAPE_GRADIENTS: Floats = HEX27.gradients(POINTS)
#: The eight pressure functions at the Gauss points, (27, 8).
PRESSURE: Floats = pressure_functions(POINTS)
