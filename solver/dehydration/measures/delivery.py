"""The surface that is handed over: nodes of the finite elements read on a lattice, so that it does not cross itself.

Splines through the nodes are smooth, and where walls fold onto each other they swing through: at te = 0.04, gamma = 10,
s = 0.3 (preview) the finite elements' own triangles cross nowhere and a spline on 128 colatitudes crosses 2,500 times.
Around those places, and nowhere else, creases are rounded (`folds`): then nothing crosses there, on any lattice, and
all stays as smooth. What crosses even so, where a lattice cuts corners that are finer than it is, is evened out in
place, step by step, until nothing does.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array

from ...arrays import Bools, Floats, Ints
from ...fruit import lattice
from ...geometry.crossings import Crossings
from ...lattice import closed_lattice
from ..fresh.mesh import FruitMesh, Sampler
from ..fresh.sector import cut
from ..params import DehydrationParams
from .facets import on_triangles
from .folds import Folds
from .penetration import of_lattice

__all__ = ["COARSE", "Delivered", "Delivery", "even_out"]

#: Lattice on which finer ones learn where to round, so that shapes differ less from one resolution to the next.
COARSE = 64
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
    """farthest that a point lies from both readings of what was solved: by splines, and off its triangles"""


class Delivery:
    """Reads surface nodes on the lattice of one resolution."""

    def __init__(self, fruit: DehydrationParams, mesh: FruitMesh, resolution: int, dtype: str) -> None:
        self._fruit, self._mesh, self._resolution, self._dtype = fruit, mesh, resolution, dtype
        self._sampler = Sampler(mesh.sphere, resolution)
        self._fresh = fruit.surface(*lattice(resolution))
        self._fresh_nodes = mesh.positions[mesh.surface_nodes]

    def __call__(self, nodes: Floats) -> Delivered:
        """Return what is handed over of nodes (nc, 3)."""
        position, moved = self._spline(nodes), 0.0
        found = self._look(position)
        if found.count:
            readings = position, (on_triangles(self._mesh.sphere, self._sampler) @ nodes).reshape(position.shape)
            position, found, _ = self._apart(nodes, position, found)
            if found.count:
                position, found = even_out(position, self._given)
            off = [np.linalg.norm(position - reading, axis=-1) for reading in readings]
            moved = float(np.minimum(*off).max())
        return Delivered((position - self._fresh).astype(self._dtype), position.astype(self._dtype), found, moved)

    def _spline(self, nodes: Floats) -> Floats:
        found: Floats = self._fresh + self._sampler(nodes - self._fresh_nodes)
        return found

    def _apart(self, nodes: Floats, spline: Floats, found: Crossings) -> tuple[Floats, Crossings, Ints]:
        """Return the surface (n, 2n, 3) with creases rounded where the spline crosses, what still does, and levels."""
        level = self._coarse._levels(nodes) if self._resolution > COARSE else np.zeros(len(nodes), np.int64)
        return self._folds.apart(spline, nodes - self._fresh_nodes, found, level)

    def _levels(self, nodes: Floats) -> Ints:
        """Return how strongly each node (nc,) is rounded: see `Folds`."""
        spline = self._spline(nodes)
        found = self._look(spline)
        return self._apart(nodes, spline, found)[2] if found.count else np.zeros(len(nodes), np.int64)

    @cached_property
    def _folds(self) -> Folds:
        image = cut(self._mesh, self._fruit.mirrors).image
        return Folds(self._mesh.sphere, self._sampler, self._fresh, self._look, image)

    @cached_property
    def _coarse(self) -> Delivery:
        return Delivery(self._fruit, self._mesh, COARSE, self._dtype)

    def _look(self, position: Floats) -> Crossings:
        return of_lattice(self._given(position))

    def _given(self, position: Floats) -> Floats:
        """Return positions as they are handed over, rounded to their type."""
        return position.astype(self._dtype).astype(np.float64)


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
