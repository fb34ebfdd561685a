"""Bending by mean curvature at vertices (Combaz and Neyret 2004, section 5), with its sign and a stiffness.

Each vertex carries the integral of its mean curvature, M = sum over its hinges of l theta / 4 (Steiner's formula, each
edge shared by its ends), against the same sum of rest angles: energy 2 D (M - M_rest)^2 / A, which is the plate's
D (2 H)^2 / 2 per area. l and A are rest lengths and areas: so where a surface grows evenly by s, its rest mean
curvature M_rest / A falls as 1 / s while the rest angles stay, and no area weights are left to differentiate. Gaussian
curvature costs nothing (Poisson's ratio 1 in bending): saddles without mean curvature are held by the membrane alone.
Over closed surfaces and inside clamped borders that bends as any plate (Gauss and Bonnet). At a free edge it is none: a
clamped strip with free sides sags as far as its mesh lets it, without a limit as that is refined.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints
from .bending import hinge_slopes
from .membrane import areas, squares
from .topology import Topology

__all__ = ["mean_bending", "mean_stiffness"]


def mean_stiffness(g: Floats, mesh: Topology, flexural: float) -> tuple[Floats, Floats]:
    """Return l / 4 of hinges (h,) and 2 D / A of vertices (n,) from rest metrics g (f, 3); vertices without area 0."""
    a, b = mesh.hinge_faces.T
    square = 0.5 * (squares(g)[a, mesh.hinge_corners[:, 0]] + squares(g)[b, mesh.hinge_corners[:, 1]])
    area = np.bincount(mesh.triangles.ravel(), np.repeat(areas(g) / 3, 3), mesh.vertices)
    return 0.25 * np.sqrt(square), np.where(area > 0, 2 * flexural / np.maximum(area, 1e-300), 0.0)


@njit(cache=True, error_model="numpy")
def mean_bending(x: Floats, hinges: Ints, rest: Floats, lengths: Floats, stiffness: Floats, gradient: Floats) -> float:
    """Return the energy and add its gradient to `gradient` (n, 3); rest, lengths (h,), stiffness (n,)."""
    slopes = np.empty((len(hinges), 4, 3))
    gaps = np.zeros(len(x))
    for t in range(len(hinges)):
        gap = lengths[t] * (hinge_slopes(x, hinges, t, slopes[t]) - rest[t])
        gaps[hinges[t, 0]] += gap
        gaps[hinges[t, 1]] += gap
    energy = 0.0
    for v in range(len(x)):
        energy += stiffness[v] * gaps[v] * gaps[v]
    for t in range(len(hinges)):
        i, j = hinges[t, 0], hinges[t, 1]
        force = 2 * lengths[t] * (stiffness[i] * gaps[i] + stiffness[j] * gaps[j])
        for v in range(4):
            at = hinges[t, v]
            for d in range(3):
                gradient[at, d] += force * slopes[t, v, d]
    return energy
