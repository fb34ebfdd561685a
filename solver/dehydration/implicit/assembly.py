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
from .element import deform, scratch_for, stiffen, stress
from .hexahedron import PRESSURE, SHAPE_GRADIENTS, WEIGHTS

__all__ = ["Assembled", "Pattern", "assemble", "build_pattern"]


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


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "arcp", "nsz"})
def _sweep(
    fresh: Floats, connectivity: Ints, deformed: Floats, stretch: Floats, mu: Floats, kappa: Floats, pressure: Floats,
    local_gradients: Floats, weights: Floats, functions: Floats, blocks: Ints, wanted: bool,
    energy: Floats, least: Floats, force: Floats, scale: Floats, condensed: Floats, gain: Floats, data: Floats,
) -> None:  # fmt: skip
    corners, many = connectivity.shape[1], functions.shape[1]
    scratch = scratch_for(len(weights), corners, many)
    defect, nodal, tangent = scratch.defect, scratch.nodal, scratch.tangent
    lowered = np.empty((3 * len(weights), corners))
    for e in range(len(connectivity)):
        nodes = connectivity[e]
        deform(fresh, deformed, nodes, stretch[e], local_gradients, weights, functions, scratch)
        inverse_mass = np.linalg.inv(scratch.mass)
        strain = inverse_mass @ defect
        condensed[e] = kappa[e] * strain
        volumes = 0.5 * kappa[e] * (strain @ defect)
        energy[e], least[e] = stress(volumes, stretch[e], mu[e], condensed[e], pressure[e], functions, wanted, scratch)
        for a in range(corners):
            for i in range(3):
                force[nodes[a], i] += nodal[a, i]
                scale[nodes[a], i] += abs(nodal[a, i])
        if not wanted:
            continue
        stiffen(lowered, scratch)
        rows = scratch.by_node.reshape(many, 3 * corners)
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
