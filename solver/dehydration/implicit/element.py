"""One hex27 element: what its Gauss points yield, whose derivation `assembly` has."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Floats, Ints

__all__ = ["Scratch", "deform", "scratch_for", "stiffen", "stress"]


LEAST = 1e-3
"""Je below which the isochoric factor is frozen, so that a crushed trial state stays finite; steps never end there."""


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


class Scratch(NamedTuple):
    """What the sweep keeps of one element, for q Gauss points, n corners and r pressures."""

    gradients: Floats
    """(q, 3, n): shape functions by the fresh position"""
    deformation: Floats
    """(q, 3, 3): F"""
    cofactor: Floats
    """(q, 3, 3): F^-T"""
    jacobian: Floats
    """(q,): J"""
    weight: Floats
    """(q,): fresh volume"""
    mass: Floats
    """(r, r): M"""
    defect: Floats
    """(r,): b"""
    by_node: Floats
    """(r, n, 3): B"""
    nodal: Floats
    """(n, 3): force"""
    moduli: Floats
    """(q, 3, 3, 3, 3): second derivative of the energy by F"""
    tangent: Floats
    """(n, 3, n, 3): second derivative by the positions, without what the condensed pressure adds"""


@njit(cache=True, inline="always")
def scratch_for(points: int, corners: int, many: int) -> Scratch:
    """Return room for elements of `corners` nodes and `many` pressures, with `points` Gauss points."""
    return Scratch(
        np.empty((points, 3, corners)),
        np.empty((points, 3, 3)),
        np.empty((points, 3, 3)),
        np.empty(points),
        np.empty(points),
        np.empty((many, many)),
        np.empty(many),
        np.empty((many, corners, 3)),
        np.empty((corners, 3)),
        np.empty((points, 3, 3, 3, 3)),
        np.empty((corners, 3, corners, 3)),
    )


@njit(cache=True, inline="always")
def deform(
    fresh: Floats, deformed: Floats, nodes: Ints, stretch: Floats, local_gradients: Floats, weights: Floats,
    functions: Floats, to: Scratch,
) -> None:  # fmt: skip
    """Find what an element's volumes and the deformation at its Gauss points are."""
    corners, many = len(nodes), functions.shape[1]
    gradients, deformation, cofactor, jacobian, weight = to[:5]
    mass, defect, by_node = to.mass, to.defect, to.by_node
    first, inverse = np.empty((3, 3)), np.empty((3, 3))
    mass[:], defect[:], by_node[:] = 0.0, 0.0, 0.0
    for q in range(len(weights)):
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
        jacobian[q] = _invert(deformation[q], inverse)
        for i in range(3):
            for k in range(3):
                cofactor[q, i, k] = inverse[k, i]
        volume = stretch[q, 0] * stretch[q, 1] * stretch[q, 2]
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


@njit(cache=True, inline="always")
def stress(
    volumetric: float,
    stretch: Floats,
    mu: float,
    condensed: Floats,
    pressure: Floats,
    functions: Floats,
    wanted: bool,
    at: Scratch,
) -> tuple[float, float]:
    """Fill nodal and, if wanted, moduli of an element; return its energy, `volumetric` included, and its least Je."""
    gradients, deformation, cofactor, jacobian, weight = at[:5]
    nodal, first = at.nodal, np.empty((3, 3))
    stored, ratio = volumetric, np.inf
    nodal[:] = 0.0
    for q in range(len(weight)):
        volume = stretch[q, 0] * stretch[q, 1] * stretch[q, 2]
        elastic = jacobian[q] / volume
        ratio = min(ratio, elastic)
        shear = mu * volume * max(elastic, LEAST) ** (-2.0 / 3.0)
        invariant, now, linear = 0.0, 0.0, 0.0
        for k in range(3):
            for i in range(3):
                first[i, k] = deformation[q, i, k] / stretch[q, k] ** 2
                invariant += first[i, k] * deformation[q, i, k]
        for r in range(len(condensed)):
            now += functions[q, r] * condensed[r]
            linear += functions[q, r] * pressure[r]
        stored += weight[q] * 0.5 * (shear * invariant - 3.0 * mu * volume)
        spherical = now * jacobian[q] - shear * invariant / 3.0
        for a in range(len(nodal)):
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
                            at.moduli[q, i, m, k, o] = (
                                (both * g - mixed * h) * cofactor[q, k, o]
                                - mixed * g * first[k, o]
                                + turned * cofactor[q, i, o] * cofactor[q, k, m]
                            )
                    at.moduli[q, i, m, i, m] += shear * weight[q] / stretch[q, m] ** 2
    return stored, ratio


@njit(cache=True, inline="always")
def stiffen(lowered: Floats, at: Scratch) -> None:
    """Fill an element's tangent from its moduli. lowered: (3 q, n) room."""
    gradients, moduli, tangent = at.gradients, at.moduli, at.tangent
    points, _, corners = gradients.shape
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
