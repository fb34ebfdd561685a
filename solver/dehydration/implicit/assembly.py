"""Energy, force and tangent of hex27 elements with a trilinear pressure per element, condensed.

F = Fe Fd with Fd = diag(d) given at every Gauss point, Jd = det Fd, I1e = sum_ik F_ik^2 / d_k^2, Je = J / Jd. Energy
per fresh volume (Liu et al. 2014, Eq. 1-4; Jd W(Fe), nearly incompressible; `solver.material` derives it):

    Jd mu/2 (Je^(-2/3) I1e - 3) + Jd kappa/2 (Pi(Je - 1))^2,

Pi the projection on the element's trilinear functions in the Jd-weighted inner product: with b_r = int phi_r (J - Jd)
and M_rs = int Jd phi_r phi_s the volumetric part is kappa/2 b M^-1 b, and the pressure p = kappa M^-1 b.

The tangent is that of the mixed problem in (u, p), with p condensed: its geometric part uses the pressure of the
linearised volume equation, not kappa M^-1 b. That makes Newton's method insensitive to kappa (3 iterations where the
tangent of the condensed energy takes 5 or more); both tangents agree where the two pressures do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Bools, Floats, Ints
from ...linalg.patterns import of_cliques, places
from .hexahedron import PRESSURE, SHAPE_GRADIENTS, WEIGHTS

__all__ = ["Assembled", "Pattern", "assemble", "build_pattern"]


LEAST = 1e-3
"""Je below which the isochoric factor is frozen, so that a crushed trial state stays finite; steps never end there."""


class Pattern(NamedTuple):
    """Pattern of the tangent by free nodes (blocks of 3x3, CSR, both triangles)."""

    free: Ints
    """(nn,): number among the free nodes, -1 on the stone"""
    indptr: Ints
    indices: Ints
    blocks: Ints
    """(ne, 27, 27): where the block of two local nodes lies in the data, -1 if one is fixed"""


class Assembled(NamedTuple):
    """What one sweep over the elements yields."""

    energy: float
    least_ratio: float
    """least Je over the Gauss points"""
    force: Floats
    """(nn, 3): derivative of the condensed energy by the positions"""
    scale: Floats
    """(nn, 3): sum of the absolute element forces"""
    pressure: Floats
    """(ne, 8): kappa M^-1 b"""
    gain: Floats
    """(ne, 8, 81): kappa M^-1 B, B = db/du; empty without the tangent"""
    data: Floats
    """(nnz, 3, 3): tangent; empty without"""


def build_pattern(connectivity: Ints, fixed: Bools) -> Pattern:
    """Return the pattern for elements (ne, 27) and nodes (nn,) that are held in all components."""
    free = np.where(fixed, -1, np.cumsum(~fixed) - 1)
    found = of_cliques(free[connectivity], int(free.max()) + 1)
    return Pattern(free, found.indptr, found.indices, places(free[connectivity], found.indptr, found.indices))


@njit(cache=True, inline="always")
def _invert(matrix: Floats, inverse: Floats) -> float:
    """Inverse of a 3x3 matrix; returns its determinant (as is, whatever its sign)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            o, p = (m + 1) % 3, (m + 2) % 3
            inverse[m, i] = matrix[j, o] * matrix[k, p] - matrix[j, p] * matrix[k, o]
    determinant: float = matrix[0, 0] * inverse[0, 0] + matrix[0, 1] * inverse[1, 0] + matrix[0, 2] * inverse[2, 0]
    for i in range(3):
        for m in range(3):
            inverse[i, m] /= determinant
    return determinant


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "arcp", "nsz"})
def _sweep(
    fresh: Floats, connectivity: Ints, deformed: Floats, stretch: Floats, mu: Floats, kappa: Floats, pressure: Floats,
    local_gradients: Floats, weights: Floats, functions: Floats, blocks: Ints, wanted: bool,
    energy: Floats, least: Floats, force: Floats, scale: Floats, condensed: Floats, gain: Floats, data: Floats,
) -> None:  # fmt: skip
    points, corners, many = len(weights), connectivity.shape[1], functions.shape[1]
    gradients = np.empty((points, 3, corners))
    deformation, cofactor = np.empty((points, 3, 3)), np.empty((points, 3, 3))
    jacobian, weight = np.empty(points), np.empty(points)
    first, inverse, inverse_gradient = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    by_node = np.empty((many, corners, 3))
    tangent = np.empty((corners, 3, corners, 3))
    moduli = np.empty((points, 3, 3, 3, 3))
    lowered = np.empty((3 * points, corners))
    nodal = np.empty((corners, 3))
    for e in range(len(connectivity)):
        nodes = connectivity[e]
        mass, defect = np.zeros((many, many)), np.zeros(many)
        by_node[:] = 0.0
        for q in range(points):
            for i in range(3):
                for k in range(3):
                    total = 0.0
                    for a in range(corners):
                        total += fresh[nodes[a], i] * local_gradients[q, a, k]
                    first[i, k] = total
            weight[q] = _invert(first, inverse) * weights[q]
            for k in range(3):
                for a in range(corners):
                    total = 0.0
                    for m in range(3):
                        total += local_gradients[q, a, m] * inverse[m, k]
                    gradients[q, k, a] = total
            for i in range(3):
                for k in range(3):
                    total = 0.0
                    for a in range(corners):
                        total += deformed[nodes[a], i] * gradients[q, k, a]
                    deformation[q, i, k] = total
            jacobian[q] = _invert(deformation[q], inverse_gradient)
            for i in range(3):
                for k in range(3):
                    cofactor[q, i, k] = inverse_gradient[k, i]
            volume = stretch[e, q, 0] * stretch[e, q, 1] * stretch[e, q, 2]
            for r in range(many):
                defect[r] += functions[q, r] * (jacobian[q] - volume) * weight[q]
                for s in range(many):
                    mass[r, s] += functions[q, r] * functions[q, s] * volume * weight[q]
            for a in range(corners):
                for i in range(3):
                    total = 0.0
                    for k in range(3):
                        total += gradients[q, k, a] * cofactor[q, i, k]
                    total *= jacobian[q] * weight[q]
                    for r in range(many):
                        by_node[r, a, i] += functions[q, r] * total
        inverse_mass = np.linalg.inv(mass)
        strain = inverse_mass @ defect
        condensed[e] = kappa[e] * strain
        stored = 0.5 * kappa[e] * (strain @ defect)
        ratio = np.inf
        nodal[:] = 0.0
        for q in range(points):
            volume = stretch[e, q, 0] * stretch[e, q, 1] * stretch[e, q, 2]
            elastic = jacobian[q] / volume
            ratio = min(ratio, elastic)
            shear = mu[e] * volume * max(elastic, LEAST) ** (-2.0 / 3.0)
            invariant, now, linear = 0.0, 0.0, 0.0
            for k in range(3):
                for i in range(3):
                    first[i, k] = deformation[q, i, k] / stretch[e, q, k] ** 2
                    invariant += first[i, k] * deformation[q, i, k]
            for r in range(many):
                now += functions[q, r] * condensed[e, r]
                linear += functions[q, r] * pressure[e, r]
            stored += weight[q] * 0.5 * (shear * invariant - 3.0 * mu[e] * volume)
            spherical = now * jacobian[q] - shear * invariant / 3.0
            for a in range(corners):
                for i in range(3):
                    total = 0.0
                    for k in range(3):
                        total += (shear * first[i, k] + spherical * cofactor[q, i, k]) * gradients[q, k, a]
                    nodal[a, i] += weight[q] * total
            if wanted:
                both = (2.0 / 9.0 * shear * invariant + linear * jacobian[q]) * weight[q]
                turned = (shear * invariant / 3.0 - linear * jacobian[q]) * weight[q]
                mixed = 2.0 / 3.0 * shear * weight[q]
                for i in range(3):
                    for m in range(3):
                        g, h = cofactor[q, i, m], first[i, m]
                        for k in range(3):
                            for o in range(3):
                                moduli[q, i, m, k, o] = (
                                    (both * g - mixed * h) * cofactor[q, k, o]
                                    - mixed * g * first[k, o]
                                    + turned * cofactor[q, i, o] * cofactor[q, k, m]
                                )
                        moduli[q, i, m, i, m] += shear * weight[q] / stretch[e, q, m] ** 2
        energy[e], least[e] = stored, ratio
        for a in range(corners):
            for i in range(3):
                force[nodes[a], i] += nodal[a, i]
                scale[nodes[a], i] += abs(nodal[a, i])
        if not wanted:
            continue
        flat = gradients.reshape(3 * points, corners)
        for i in range(3):
            for k in range(i, 3):
                for q in range(points):
                    for m in range(3):
                        c0, c1, c2 = moduli[q, i, m, k, 0], moduli[q, i, m, k, 1], moduli[q, i, m, k, 2]
                        for b in range(corners):
                            lowered[3 * q + m, b] = (
                                c0 * gradients[q, 0, b] + c1 * gradients[q, 1, b] + c2 * gradients[q, 2, b]
                            )
                part = np.dot(flat.T, lowered)
                for a in range(corners):
                    for b in range(corners):
                        tangent[a, i, b, k] = part[a, b]
                        tangent[b, k, a, i] = part[a, b]
        rows = by_node.reshape(many, 3 * corners)
        gained = kappa[e] * np.dot(inverse_mass, rows)
        gain[e] = gained
        volumetric = np.dot(rows.T, gained)
        for a in range(corners):
            for b in range(corners):
                block = blocks[e, a, b]
                if block >= 0:
                    for i in range(3):
                        for k in range(3):
                            data[block, i, k] += tangent[a, i, b, k] + volumetric[3 * a + i, 3 * b + k]


def assemble(
    fresh: Floats, connectivity: Ints, deformed: Floats, stretch: Floats, mu: Floats, kappa: Floats,
    pressure: Floats | None = None, pattern: Pattern | None = None,
) -> Assembled:  # fmt: skip
    """Sweep over the elements; with `pressure` and `pattern` also assemble the tangent.

    fresh, deformed: (nn, 3). connectivity: (ne, 27). stretch: (ne, 27, 3) diagonal of Fd at the Gauss points.
    mu, kappa: (ne,). pressure: (ne, 8) of the geometric part of the tangent.
    """
    count = len(connectivity)
    wanted = pattern is not None and pressure is not None
    energy, least, condensed = np.empty(count), np.empty(count), np.empty((count, PRESSURE.shape[1]))
    force, scale = np.zeros((len(fresh), 3)), np.zeros((len(fresh), 3))
    gain = np.empty((count if wanted else 0, PRESSURE.shape[1], 81))
    data = np.zeros((len(pattern.indices) if wanted and pattern else 0, 3, 3))
    blocks = pattern.blocks if pattern is not None else np.empty((0, 27, 27), np.int64)
    at = pressure if pressure is not None else np.zeros((count, PRESSURE.shape[1]))
    _sweep(
        fresh, connectivity, deformed, stretch, mu, kappa, at, SHAPE_GRADIENTS, WEIGHTS, PRESSURE, blocks, wanted,
        energy, least, force, scale, condensed, gain, data,
    )  # fmt: skip
    return Assembled(float(energy.sum()), float(least.min()), force, scale, condensed, gain, data)
