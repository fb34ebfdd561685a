"""The surface that is handed over: nodes of the finite elements read on a lattice, so that it does not cross itself.

Splines through the nodes are smooth, and where walls fold onto each other they swing through: at te = 0.04, gamma = 10,
s = 0.3 (preview) the finite elements' own triangles cross nowhere and a spline on 128 colatitudes crosses 6,500 times.
So a stage whose spline crosses is read off those triangles, as solved. What then still crosses, where a lattice cuts
corners that are finer than it is, is evened out in place, step by step, until nothing does: 36 pairs there, on 0.9 % of
the surface, rms 0.0016 r1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from ...arrays import Bools, Floats
from ...fruit import Fruit, lattice
from ...geometry.crossings import Crossings
from ...lattice import closed_lattice
from ..fresh.mesh import CubedSphere, FruitMesh, Sampler
from .penetration import of_lattice

__all__ = ["Delivered", "Delivery", "even_out", "on_triangles"]

#: Rounds of evening out; what crosses after them is delivered, and said.
_ROUNDS = 60


class Delivered(NamedTuple):
    """A surface on the lattice, as it is handed over."""

    displacement: Any
    """(n, 2n, 3) in the type that was asked for"""
    position: Any
    """(n, 2n, 3) likewise"""
    found: Crossings
    """where it crosses itself"""
    moved: float
    """farthest that evening out moved a point off the solved triangles"""


class Delivery:
    """Reads surface nodes on the lattice of one resolution."""

    def __init__(self, fruit: Fruit, mesh: FruitMesh, resolution: int, dtype: str) -> None:
        self._mesh, self._dtype = mesh, dtype
        self._sampler = Sampler(mesh.sphere, resolution)
        self._fresh = fruit.surface(*lattice(resolution))
        self._fresh_nodes = mesh.positions[mesh.surface_nodes]

    def __call__(self, nodes: Floats) -> Delivered:
        """Return what is handed over of nodes (nc, 3)."""
        position, moved = self._fresh + self._sampler(nodes - self._fresh_nodes), 0.0
        found = of_lattice(self._rounded(position))
        if found.count:
            linear = (on_triangles(self._mesh.sphere, self._sampler) @ nodes).reshape(position.shape)
            position, found = even_out(linear, self._rounded)
            moved = float(np.linalg.norm(position - linear, axis=-1).max())
        return Delivered((position - self._fresh).astype(self._dtype), position.astype(self._dtype), found, moved)

    def _rounded(self, position: Floats) -> Floats:
        return position.astype(self._dtype).astype(np.float64)


def on_triangles(sphere: CubedSphere, sampler: Sampler) -> csr_array:
    """Return the weights (lattice points, nd) that read a nodal field off the triangles that quads are cut into."""
    n = sphere.n
    places = (np.stack([sampler.alpha, sampler.beta], axis=1) + np.pi / 4) * (2 * n / np.pi)
    cell = np.clip(places.astype(np.int64), 0, n - 1)
    u, v = np.clip(places - cell, 0, 1).T
    corners = sphere.quads.reshape(6, n, n, 4)[sampler.face, cell[:, 0], cell[:, 1]]
    # quads begin at the corner (0, 0), or one further, at (1, 0): see `cubed_sphere`
    turned = corners[:, 0] != sphere.faces[sampler.face, cell[:, 0], cell[:, 1]]
    u, v = np.where(turned, v, u), np.where(turned, 1 - u, v)
    # seen from their first corner: (0, 0), (1, 0), (1, 1), (0, 1), cut from (0, 0) to (1, 1)
    upper = v > u
    rows = np.repeat(np.arange(len(u)), 3)
    columns = np.stack([corners[:, 0], np.where(upper, corners[:, 3], corners[:, 1]), corners[:, 2]], axis=1)
    weights = np.stack([1 - np.maximum(u, v), abs(u - v), np.minimum(u, v)], axis=1)
    shape = len(u), len(sphere.directions)
    return coo_array((weights.ravel(), (rows, columns.ravel())), shape).tocsr()


def even_out(position: Floats, rounded: Any = lambda position: position) -> tuple[Floats, Crossings]:
    """Return the lattice surface (n, 2n, 3) with what crosses evened out, and what still does.

    Vertices of crossing triangles and their neighbours go halfway to the mean of their neighbours, round after round.
    All others stay where they are. rounded: how positions are handed over.
    """
    n, ring = len(position), 2 * len(position)
    found = of_lattice(rounded(position))
    triangles = closed_lattice(n)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    size = n * ring + 2
    ends = np.concatenate([edges, edges[:, ::-1]]).T
    near = coo_array((np.ones(ends.shape[1]), ends), (size, size)).tocsr()
    count = near.sum(axis=1)
    for _ in range(_ROUNDS):
        if not found.count:
            break
        marked = np.zeros(size)
        marked[triangles[found.pairs].ravel()] = 1
        moving: Bools = (marked + near @ marked > 0)[:-2]
        whole = np.concatenate([position.reshape(-1, 3), position[[0, -1]].mean(axis=1)])
        mean = (near @ whole / count[:, None])[:-2]
        position = np.where(moving[:, None], (whole[:-2] + mean) / 2, whole[:-2]).reshape(position.shape)
        found = of_lattice(rounded(position))
    return position, found
