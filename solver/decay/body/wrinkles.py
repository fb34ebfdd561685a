"""A fruit's skin on its moving body: how far it stands off from where the body carries it."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import sparse

from ...arrays import Floats
from ...contract import Context
from ...shell import metric
from ...shell.normals import normals
from ..fields.noise import patches
from ..fields.skin import laid
from ..params import DecayParams
from ..settings import Settings
from ..surfaces.surface import geodesic, sampler, shares_at
from .body import Body
from .equilibrium import Balance
from .flesh import Skin
from .skin import Settled, Shell

__all__ = ["Wrinkles"]

#: Size of the places that hold the skin alike, where they differ: about a dimple's width; a choice [r1].
_LOOSE = 0.5


class Wrinkles:
    """The skin of one fruit on a geodesic sphere of its own, between the body's and the fields', or on its own mesh."""

    def __init__(self, params: DecayParams, skin: Skin, body: Body, settings: Settings) -> None:
        self._body, self._skin, self._seed = body, skin, params.seed
        self._cells, self._fields, self._tolerance = settings.skin, settings.cells, settings.smooth
        self._own = params.mesh is not None
        surface = laid(params, settings.skin)
        self._points = surface.points
        if self._own:
            self._normals = normals(surface.points, surface.faces)
        else:
            self._normals = surface.points / np.linalg.norm(surface.points, axis=1, keepdims=True)
        fresh = metric(surface.points, surface.faces)
        self._faces, self._square = surface.faces, fresh[:, 0] * fresh[:, 2] - fresh[:, 1] ** 2
        firm: Floats | float = 1.0
        if skin.uneven_hold > 0:
            # the fifth stream: the first four are those of the fields and of what lands
            generator = Context.generator(params.seed).spawn(5)[-1]
            firm = 1 + skin.uneven_hold * patches(surface.points, _LOOSE, generator)
        self._shell = Shell(surface.points, surface.faces, surface.area, skin, params.exocarp_thickness, firm)

    def at(
        self,
        balance: Balance,
        near: Settled | None = None,
        watch: Callable[[], None] = lambda: None,
        earlier: Settled | None = None,
    ) -> Settled:
        """Return how far the skin stands off (v, 3) from the settled body, in place of its points.

        near: what `at` found in the stage to start from; None starts from a slightly uneven skin.
        earlier: what was found as long before `near` as the balance comes after it: both then say where it goes.

        Raises:
            NotConverged: the skin found no equilibrium.

        """
        even, rest = self._body.parted(balance)
        carried = (1 + even) * self._points + self._body.onto(self._cells) @ rest
        share = self._share(carried, balance.dried)
        folds = near.points if near else self._shell.uneven(self._normals, Context.generator(self._seed))
        model = near.model if near else None
        ahead = carried + 2 * near.points - earlier.points if near and earlier else None
        found = self._shell.wrinkled(
            carried, share, carried + folds, self._tolerance, model, watch, self._body.obstacles, ahead
        )
        return found._replace(points=found.points - carried)

    def _share(self, carried: Floats, dried: float) -> Floats:
        """Return lengths of the skin over its fresh ones (f): it joins its place's collapse, and folds only so deep.

        A skin pressed to less than some .75 of its lengths both ways has no folds that its mesh could show: triangles
        close like books, and none of them finds a balance.
        """
        there = metric(carried, self._faces)
        area = np.maximum(there[:, 0] * there[:, 2] - there[:, 1] ** 2, 0) / self._square
        covered = np.sqrt(np.sqrt(area))
        joined = 1 - self._skin.joining * (1 - np.minimum(covered / dried, 1.0))
        own = (1 + self._skin.shrinkage * (dried - 1)) * joined
        return np.asarray(np.minimum(own, covered / (1 - self._skin.slack)))

    def on_lattice(self, folds: Floats, resolution: int) -> Floats:
        """Return what `at` found on the common lattice (n, 2 n, 3)."""
        return (sampler(self._cells, resolution) @ folds).reshape(resolution, -1, 3)

    def on_surface(self, folds: Floats) -> Floats:
        """Return what `at` found on the vertices of the fields' surface (v, 3)."""
        return folds if self._own else np.asarray(_between(self._cells, self._fields) @ folds)


@lru_cache(maxsize=4)
def _between(cells: int, finer: int) -> sparse.csr_array:
    """Return the matrix that takes a field of one geodesic sphere to the points of another."""
    return shares_at(*geodesic(cells), geodesic(finer)[0])
