"""A meshed fruit under its loading: what the march is told as the shrinkage goes on."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from ..arrays import Floats, Ints32
from .fresh.loading import Loading
from .fresh.mesh import FruitMesh
from .kernel import Layout, place, positions
from .kernel.reload import reload
from .params import DehydrationParams

__all__ = ["Drive"]


#: Largest shrinkage between two updates of targets and inner nodes. Halves and tenths move the surface by 1e-7 r1.
_PIECE = 1e-3


class Drive:
    """A meshed fruit under its loading: targets of the core, places of the inner nodes, and a smooth start.

    idle: the kernel's one theta and resting inner nodes say it all, and every method hands back what it was given.
    """

    def __init__(self, params: DehydrationParams, mesh: FruitMesh, layout: Layout) -> None:
        self.loading = Loading(params)
        self.idle: bool = self.loading.uniform and params.has_stone
        self._mesh, self._fresh = mesh, layout
        self._points = positions(layout.fresh)
        self._inner = np.flatnonzero(mesh.fixed)
        self._centres = np.empty((0, 3))
        if not self.loading.uniform:
            # the perfect mesh: bumps of a thousandth of r1 are no part of the environment
            self._centres = mesh.positions[mesh.connectivity].mean(axis=1)

    def pieces(self, begin: float, end: float, steps: int) -> Iterator[tuple[float, float, int]]:
        """Split a march of `steps` into (begin, end, steps), each under the loading of its middle."""
        count = 1 if self.idle else max(1, min(steps, math.ceil(abs(end - begin) / _PIECE)))
        at = [steps * k // count for k in range(count + 1)]
        for first, last in itertools.pairwise(at):
            yield begin + (end - begin) * first / steps, begin + (end - begin) * last / steps, last - first

    def loaded(self, layout: Layout, shrinkage: float) -> Layout:
        """Return `layout` with the core's targets at `shrinkage`; the kernel is to march at theta = 1 - shrinkage."""
        if self.loading.uniform:
            return layout
        return reload(layout, self._fresh, self.loading.fd(self._centres, shrinkage) / (1 - shrinkage))

    def lead(self, state: Ints32, shrinkage: float) -> None:
        """Put the inner nodes of `state` (nodes, 4) where they are at `shrinkage`."""
        if not self.idle:
            part = np.zeros((len(self._inner), 4), np.int32)
            place(part, self.loading.held(self._points[self._inner], shrinkage))
            state[self._inner] = part

    def smooth(self, shrinkage: float) -> Floats:
        """Return smooth positions (nn, 3) at `shrinkage`: incompressible along each ray, exact for a sphere.

        r^3 = r_0^3 + sum over the layers of det(Fd) (R_k+1^3 - R_k^3), r_0 being the inner node's distance. In a fruit
        without a stone rays are stretched as well, so that x = Fd X where Fd is the same everywhere.
        """
        mesh, loading = self._mesh, self.loading
        columns = self._points.reshape(len(mesh.rays), mesh.levels, 3)
        middles = (columns[:, 1:] + columns[:, :-1]) / 2
        share = loading.fd(middles.reshape(-1, 3), shrinkage).prod(axis=1).reshape(middles.shape[:2])
        share[:, mesh.depth[:-1] == 1] = 1.0
        distance = np.linalg.norm(columns, axis=-1)
        cubes = distance**3
        stretch = loading.held(np.ones((1, 3)), shrinkage)[0]
        cubes[:, 1:] = np.cumsum(share * np.diff(cubes, axis=1), axis=1) + cubes[:, :1] * stretch.prod()
        cubes[:, 0] *= stretch.prod()
        moved = columns * (np.cbrt(cubes / stretch.prod()) / distance)[..., None] * stretch
        where: Floats = moved.reshape(-1, 3)
        return where
