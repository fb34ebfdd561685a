"""Lattice points on the finite elements' own triangles: in which quad each lies, and what it reads there."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array

from ...arrays import Floats, Ints
from ..fresh.mesh import CubedSphere, Sampler

__all__ = ["corners", "on_triangles"]


def corners(sphere: CubedSphere, sampler: Sampler) -> Ints:
    """Return the nodes (points, 4) of the quad that each lattice point lies in."""
    cell, _ = _cells(sphere, sampler)
    found: Ints = sphere.quads.reshape(6, sphere.n, sphere.n, 4)[sampler.face, cell[:, 0], cell[:, 1]]
    return found


def on_triangles(sphere: CubedSphere, sampler: Sampler) -> csr_array:
    """Return the weights (lattice points, nd) that read a nodal field off the triangles that quads are cut into."""
    cell, place = _cells(sphere, sampler)
    nodes, (u, v) = corners(sphere, sampler), place.T
    # quads begin at the corner (0, 0), or one further, at (1, 0): see `cubed_sphere`
    turned = nodes[:, 0] != sphere.faces[sampler.face, cell[:, 0], cell[:, 1]]
    u, v = np.where(turned, v, u), np.where(turned, 1 - u, v)
    # seen from their first corner: (0, 0), (1, 0), (1, 1), (0, 1), cut from (0, 0) to (1, 1)
    upper = v > u
    rows = np.repeat(np.arange(len(u)), 3)
    columns = np.stack([nodes[:, 0], np.where(upper, nodes[:, 3], nodes[:, 1]), nodes[:, 2]], axis=1)
    weights = np.stack([1 - np.maximum(u, v), abs(u - v), np.minimum(u, v)], axis=1)
    shape = len(u), len(sphere.directions)
    return coo_array((weights.ravel(), (rows, columns.ravel())), shape).tocsr()


def _cells(sphere: CubedSphere, sampler: Sampler) -> tuple[Ints, Floats]:
    """Return the cell of its face that each lattice point lies in, and where in it, 0 to 1; both (points, 2)."""
    places = (np.stack([sampler.alpha, sampler.beta], axis=1) + np.pi / 4) * (2 * sphere.n / np.pi)
    cell = np.clip(places.astype(np.int64), 0, sphere.n - 1)
    return cell, np.clip(places - cell, 0, 1)
