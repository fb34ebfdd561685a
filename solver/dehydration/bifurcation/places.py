"""Where on a fruit of any shape wrinkles come first: the thin shell's estimate, place by place.

A wave of wavenumber k whose crests run along a direction of curvature c needs, in a film of thickness h and modulus
gamma on a half-space of modulus 1, a compression gamma h^2 k^2 / 3 + 2 / (h k) + 3 gamma c^2 / k^2 across the crests:
bending, the flesh below, the stretching of crests on a curved surface. What the skin bears is read off a smooth state.
h is across the skin: `exocarp_thickness` is measured along rays, and where these are oblique the film is thinner (.8 of
it where plum 1 wrinkles first) and its waves are shorter by as much.
The least over the surface is within 2.5 % of the exact onset of the reference's spheres and of Table 1's axisymmetric
fruits: it says where to look, and from which shrinkage.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ...fem import HEX27
from ..implicit import BaseState

__all__ = ["Places", "expected_onsets"]


#: Wavenumbers that are tried, relative to the flat film's.
_WAVES = np.geomspace(0.4, 4.0, 60)
#: Waves of one place cannot come later than this, for ranking.
_NEVER = 1e3


class Places(NamedTuple):
    """The outer faces of a mesh and what the thin shell's estimate says of them."""

    middles: Floats
    """(ns, 3) [r1]"""
    onsets: Floats
    """(ns,): shrinkage at which a place would wrinkle by itself"""
    widths: Floats
    """(ns, 2): the farther that an edge of a face reaches [r1] across the crests and along them"""
    thinned: Floats
    """(ns,): thickness across the skin over that along the ray"""
    crests: Floats
    """(ns, 3): unit tangents along the crests"""


def expected_onsets(base: BaseState) -> Places:
    """Return what the estimate makes of a coarse smooth state."""
    mesh, params = base.mesh, base.params
    gamma = params.modulus_ratio
    skin = np.flatnonzero(mesh.is_exocarp).reshape(len(mesh.stacks), -1)[:, -1]
    fresh, moved = base.nodes[mesh.connectivity[skin]], base.displaced[mesh.connectivity[skin]]
    middle = np.zeros((1, 3))
    first, tangents = (np.einsum("eai,ak->eki", at, HEX27.gradients(middle)[0, :, :2]) for at in (fresh, moved))
    grid = fresh.reshape(-1, 3, 3, 3, 3)[:, :, :, 2]
    normal = np.cross(first[:, 0], first[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    rays = grid[:, 1, 1] / np.linalg.norm(grid[:, 1, 1], axis=1)[:, None]
    thinned = np.abs(np.einsum("ek,ek->e", normal, rays))
    h = params.exocarp_thickness * thinned[:, None]
    second = np.empty((len(skin), 2, 2, 3))
    second[:, 0, 0] = grid[:, 2, 1] - 2 * grid[:, 1, 1] + grid[:, 0, 1]
    second[:, 1, 1] = grid[:, 1, 2] - 2 * grid[:, 1, 1] + grid[:, 1, 0]
    second[:, 0, 1] = second[:, 1, 0] = (grid[:, 2, 2] - grid[:, 2, 0] - grid[:, 0, 2] + grid[:, 0, 0]) / 4
    # an orthonormal frame of the fresh surface, in which stretch and curvature are 2 x 2
    inverse = np.linalg.inv(np.linalg.cholesky(first @ first.swapaxes(1, 2)))
    stretch = inverse @ (tangents @ tangents.swapaxes(1, 2)) @ inverse.swapaxes(1, 2)
    curvature = inverse @ np.einsum("eijk,ek->eij", second, normal) @ inverse.swapaxes(1, 2)
    squares, frames = np.linalg.eigh(stretch)
    # incompressible, and free of load outside
    borne = gamma * (1 / (squares[:, 0] * squares[:, 1]) - squares[:, 0])
    crests = np.einsum("ei,eij,ej->e", frames[:, :, 1], curvature, frames[:, :, 1])
    k = _WAVES / h * np.cbrt(3 / gamma)
    needed = (gamma * (h * k) ** 2 / 3 + 2 / (h * k) + 3 * gamma * (crests[:, None] / k) ** 2).min(axis=1)
    found: Floats = base.state.shrinkage * np.minimum(needed / np.maximum(borne, needed / _NEVER), _NEVER)
    # edges of a face in the frame, turned to the crests
    edges = 2 * np.linalg.cholesky(first @ first.swapaxes(1, 2)) @ frames
    along = np.einsum("ei,eij,ejk->ek", frames[:, :, 1], inverse, first)
    return Places(grid[:, 1, 1], found, np.abs(edges).max(axis=1), thinned, along)
