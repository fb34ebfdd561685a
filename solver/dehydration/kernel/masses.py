"""Scaled masses that make the critical time step of central differences 1 for every element.

The lumped mass of the dynamics is free (only equilibria matter), so each element gives each of its nodes the mass
m_e = safety * lambda_max(K_e) / 4. The spectrum of the assembled M^-1 K lies within the extremes of the elements'
(K_e, m_e I), so the highest angular frequency is below 2 and a unit step is stable.

lambda_max(K_e) is bounded from above, for every element, without an eigenvalue solver:

    K_e = A + c b b^T / |b|^2,   c = kappa |b|^2 / V,   b = grad of the element's volume,   0 <= A <= 2 mu L (x) I,

with L the scalar stiffness (integral of grad N_a . grad N_b). With a >= lambda_max(A) and beta >= b^T A b / |b|^2 the
largest eigenvalue is at most that of the 2x2 matrix c e1 e1^T + v v^T, v = (sqrt beta, sqrt a). Nearly incompressible
elements have c >> a, so the bound is tight there (1-3 % above the true value at kappa/mu = 30; up to 2.5x at
kappa/mu = 1, which only costs steps).
"""

from __future__ import annotations

import numpy as np

from solver.dehydration.kernel.algebra import HOURGLASS
from solver.dehydration.kernel.metric import (
    CORNERS,
    SLOPES,
    inverse_jacobians,
    one_point_geometry,
    quadrature,
)

from ...arrays import Floats

CHUNK = 2048
"""Elements handled at once: bounds the temporaries to a few MB."""


def _one_point_laplacian(corners: Floats) -> Floats:
    """Scalar stiffness (ne, 8, 8) of the one-point element with hourglass control, see `elements.mean_shear`."""
    geometry = one_point_geometry(corners)
    metric = geometry.metric
    hourglass = np.stack([np.prod(np.where([m & 4, m & 2, m & 1], CORNERS, 1.0), axis=1) for m in HOURGLASS])
    beyond = hourglass - geometry.linear @ CORNERS.T
    affine = CORNERS.T + geometry.mean.transpose(0, 2, 1) @ beyond[:, :3]
    third = metric / 3
    coupling = np.zeros((len(corners), 4, 4))
    coupling[:, 0, 0] = third[:, 0, 0] + third[:, 1, 1]
    coupling[:, 1, 1] = third[:, 1, 1] + third[:, 2, 2]
    coupling[:, 2, 2] = third[:, 0, 0] + third[:, 2, 2]
    coupling[:, 3, 3] = np.trace(third, axis1=1, axis2=2) / 3
    coupling[:, 0, 1] = coupling[:, 1, 0] = third[:, 0, 2]
    coupling[:, 0, 2] = coupling[:, 2, 0] = third[:, 1, 2]
    coupling[:, 1, 2] = coupling[:, 2, 1] = third[:, 0, 1]
    return affine.transpose(0, 2, 1) @ metric @ affine + beyond.transpose(0, 2, 1) @ coupling @ beyond


def _stiffness_bound(laplacian: Floats, gradient: Floats, volume: Floats, mu: Floats, kappa: Floats) -> Floats:
    """The bound of the module's head, (ne,), for laplacian (ne, 8, 8) and volume gradient b (ne, 8, 3)."""
    squared = laplacian @ laplacian
    # Frobenius norm of L^2 bounds lambda_max(L)^2.
    shear = 2 * mu * np.sqrt(np.linalg.norm(squared, axis=(1, 2)))
    norm = np.sum(gradient * gradient, axis=(1, 2))
    along = 2 * mu * np.sum(gradient * (laplacian @ gradient), axis=(1, 2)) / norm
    bulk = kappa * norm / volume
    total = bulk + along + shear
    bound: Floats = 0.5 * (total + np.sqrt(np.maximum(total * total - 4 * bulk * shear, 0.0)))
    return bound


def largest_stiffness(corners: Floats, mu: Floats, kappa: Floats, exocarp: bool, *, one_point: bool = True) -> Floats:
    """Upper bound (ne,) of lambda_max of each element's stiffness at rest; corners (ne, 8, 3).

    Core elements get the larger of the bounds of the 2x2x2 and, if `one_point`, the one-point element.
    """
    slopes, weights = SLOPES[exocarp], quadrature(exocarp)[1]
    result = np.empty(len(corners))
    for first in range(0, len(corners), CHUNK):
        part = slice(first, first + CHUNK)
        inverse, determinants = inverse_jacobians(corners[part], slopes)
        volumes = determinants * weights
        gradients = (slopes @ inverse).transpose(0, 2, 1, 3)
        weighted = gradients * volumes[:, None, :, None]
        volume = volumes.sum(axis=1)
        by_node = (len(volume), 8, -1)
        laplacian = weighted.reshape(by_node) @ gradients.reshape(by_node).transpose(0, 2, 1)
        gradient = weighted.sum(axis=2)
        bound = _stiffness_bound(laplacian, gradient, volume, mu[part], kappa[part])
        if one_point and not exocarp:
            single = _one_point_laplacian(corners[part])
            bound = np.maximum(bound, _stiffness_bound(single, gradient, volume, mu[part], kappa[part]))
        result[part] = bound
    return result
