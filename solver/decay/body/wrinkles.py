"""A fruit's skin on its moving body: how far it stands off from where the body carries it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Floats
from ...contract import Context
from ..params import DecayParams
from ..settings import Settings
from ..surfaces.surface import geodesic, lay, sampler, shares_at
from .body import Body
from .equilibrium import Balance
from .flesh import Skin
from .skin import Settled, Shell

__all__ = ["Wrinkles"]


class Wrinkles:
    """The skin of one fruit on a geodesic sphere of its own, between the body's and the fields'."""

    def __init__(self, params: DecayParams, skin: Skin, body: Body, settings: Settings) -> None:
        self._body, self._skin, self._seed = body, skin, params.seed
        self._cells, self._fields, self._tolerance = settings.skin, settings.cells, settings.smooth
        surface = lay(params, settings.skin)
        self._points = surface.points
        self._normals = surface.points / np.linalg.norm(surface.points, axis=1, keepdims=True)
        self._shell = Shell(surface.points, surface.faces, surface.area, skin, params.exocarp_thickness)

    def at(self, balance: Balance, near: Settled | None = None, watch: Callable[[], None] = lambda: None) -> Settled:
        """Return how far the skin stands off (v, 3) from the settled body, in place of its points.

        near: what `at` found in the stage to start from; None starts from a slightly uneven skin.

        Raises:
            NotConverged: the skin found no equilibrium.

        """
        even, rest = self._body.parted(balance)
        carried = (1 + even) * self._points + self._body.onto(self._cells) @ rest
        share = 1 + self._skin.shrinkage * even
        folds = near.points if near else self._shell.uneven(self._normals, Context.generator(self._seed))
        model = near.model if near else None
        found = self._shell.wrinkled(carried, share, carried + folds, self._tolerance, model, watch)
        return found._replace(points=found.points - carried)

    def on_lattice(self, folds: Floats, resolution: int) -> Floats:
        """Return what `at` found on the common lattice (n, 2 n, 3)."""
        return (sampler(self._cells, resolution) @ folds).reshape(resolution, -1, 3)

    def on_surface(self, folds: Floats) -> Floats:
        """Return what `at` found on the vertices of the fields' surface (v, 3)."""
        return shares_at(*geodesic(self._cells), geodesic(self._fields)[0]) @ folds
