"""Where the surface is in a stage: as fresh, moved with a body that lost water and rotted, or as a table says."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...arrays import Floats, Ints32
from ...contract import Context, InvalidInput, Need
from ...contract.mesh import named_groups
from ...fruit import lattice, window
from ..body.flesh import Booked
from ..environment import reference_radius, water_lost
from ..fields.skin import laid
from ..names import BODY
from ..params import DecayParams
from ..puddle import puddle_radius
from ..settings import Settings, moved
from . import dried
from .imported import extent_of
from .surface import Surface, extent, geodesic

if TYPE_CHECKING:
    from ..body.body import Body
    from ..body.equilibrium import Balance
    from ..body.skin import Settled
    from ..within.inner import Held, Inner

__all__ = ["Shape", "volume_of"]


class _Settled(NamedTuple):
    """A body and how far its skin stands off from it."""

    balance: Balance | None
    folds: Settled | None


_NONE = _Settled(None, None)


class Shape:
    """What the need asks of the fruit's shape, water lost included; nothing else is laid, filled or settled.

    surface: the mesh that was laid, if one had to be. inner: flesh with fields of its own, put in by who steps them.
    """

    def __init__(self, params: DecayParams, need: Need, settings: Settings) -> None:
        self._params, self._need = params, need
        self._wanted = set(need.fields)
        moves = moved(params, self._wanted)
        meshed = not {"volume", "density", "mesh_position", "triangle"}.isdisjoint(self._wanted)
        self._dries = params.body == "table" and not BODY.isdisjoint(self._wanted)
        self._rays = geodesic(settings.cells)[0] if self._dries and meshed else None
        own = params.mesh is not None
        self.surface = laid(params, settings.cells) if moves or meshed or own else None
        # an open patch does not say how much it closes: water is lost by the fruit of the parameters
        self._closed = extent_of(self.surface) if own and self.surface is not None else extent(params)
        self._extent = self._closed or extent(params)
        self.inner: Inner | None = None
        self._body: Body | None = None
        self._wrinkles = None
        self._node = self._earlier = _NONE
        if moves and self.surface is not None:
            from ..body.body import Body

            self._body = Body(params, self.surface, settings.cells, settings.layers, settings.balance)
            if params.skin is not None:
                from ..body.wrinkles import Wrinkles

                self._wrinkles = Wrinkles(params, params.skin, self._body, settings)

    @property
    def body(self) -> Body | None:
        """The body that moves, if one does."""
        return self._body

    def check(self, context: Context) -> None:
        """Refuse, before any step, what no table can answer.

        Raises:
            InvalidInput: the need names the flesh, or the fruit on the last day lies outside the table; or it asks an
                imported mesh for what only the fruit has.

        """
        if self._params.mesh is not None:
            if "displacement" in self._wanted or self._need.region is not None:
                raise InvalidInput(
                    "an imported mesh has no lattice of colatitudes.",
                    advice="Ask for fields without a region, and no displacement.",
                )
            if "volume" in self._wanted and self._closed is None:
                raise InvalidInput("an open mesh has no volume.", advice="Close it, or leave the volume out.")
            if "density" in self._wanted and self._closed is None and self._body is not None:
                raise InvalidInput("an open mesh has no density.", advice="Close it, or leave the density out.")
        if self._dries:
            dried.check(self._params, self._need)
            dried.displaced(self._params, 0.0, 4, context)
            self._check_dry(self._need.stages[-1], context)

    def _check_dry(self, day: float, context: Context) -> None:
        """Refuse what no table holds so dry, in the words of days, which were asked for."""
        water = self.lost(day)
        try:
            dried.displaced(self._params, water, 4, context)
        except InvalidInput as error:
            lost = f"{water:.0%} of the weight and s = {dried.shrinkage(self._params, water):.3g} of each length"
            raise InvalidInput(
                f"by day {day:g} {lost} are lost: {error.message}",
                advice="Ask for earlier days, or take body=quasi-static.",
            ) from error

    @property
    def textured(self) -> dict[str, Any]:
        """Texture coordinates and materials of an imported mesh, as variables; none of one that has none."""
        mesh = self._params.mesh
        found: dict[str, Any] = {}
        if mesh is not None and mesh.uv:
            found["texture_coordinate"] = (("texture_vertex", "uv"), np.array(mesh.uv, float))
            found["texture_triangle"] = (("face", "corner"), np.array(mesh.uv_faces, np.int32))
        if mesh is not None and mesh.face_materials:
            found["face_material"] = (("face",), np.array(mesh.face_materials, np.int32))
        if mesh is not None and mesh.groups:
            found["group_weight"] = (("vertex", "group"), np.array(list(mesh.groups.values()), np.float32).T)
        return found

    @property
    def materials(self) -> dict[str, str]:
        """Names of an imported mesh's materials and groups, as attributes."""
        mesh = self._params.mesh
        if mesh is None:
            return {}
        return ({"materials": json.dumps(mesh.materials)} if mesh.materials else {}) | named_groups(mesh.groups)

    @property
    def triangles(self) -> Ints32:
        """Faces (f, 3) of the surface whose vertices are `mesh_position`."""
        assert self.surface is not None
        return self.surface.faces.astype(np.int32)

    def at(self, water: float, rot: Floats | None, held: Held | None, context: Context) -> dict[str, Any]:
        """Return the wanted shape of a day, with rot (v) on the surface's vertices and what the flesh holds.

        Raises:
            NotConverged: body or skin found no equilibrium.
            InvalidInput: the table of dried fruits does not reach there.

        """
        wanted, need = self._wanted, self._need
        row: dict[str, Any] = {}
        (balance, folds), found = self._settled((water, rot, held), context)
        row |= found
        booked = balance.booked if balance and balance.booked else Booked(1 - water, water, 0.0, 0.0)
        row |= self._weighed(booked)
        if self.inner is not None and "flesh_position" in wanted:
            row["flesh_position"] = self.inner.positions(balance).astype(need.dtype)
        if "least_jacobian" in wanted:
            row["least_jacobian"] = balance.least_jacobian if balance else 1.0
        if wanted & {"position", "displacement"}:
            assert need.resolution is not None  # settled
            inside = window(need.resolution, need.region)
            fresh = self._params.surface(*lattice(need.resolution))
            gone = self._body.on_lattice(balance, need.resolution) if self._body and balance else np.zeros_like(fresh)
            if self._dries:
                gone = self._dried(water, need.resolution, context)
            if self._wrinkles and folds is not None:
                gone = gone + self._wrinkles.on_lattice(folds.points, need.resolution)
            if self._body and balance:
                gone = self._body.obstacles.laid((fresh + gone).reshape(-1, 3)).reshape(fresh.shape) - fresh
            for name, values in (("position", fresh + gone), ("displacement", gone)):
                if name in wanted:
                    row[name] = values[inside].astype(need.dtype)
        if wanted & {"mesh_position", "volume", "density"}:
            assert self.surface is not None
            points = self.surface.points
            if self._body and balance:
                points = points + self._body.on_surface(balance)
            if self._wrinkles and folds is not None:
                points = points + self._wrinkles.on_surface(folds.points)
            if self._body and balance:
                points = self._body.obstacles.laid(points)
            if self._rays is not None:
                points = points + dried.at_rays(self._dried(water, dried.ROWS, context), self._rays)
            if "mesh_position" in wanted:
                row["mesh_position"] = points.astype(need.dtype)
            if "volume" in wanted:
                row["volume"] = volume_of(points, self.surface)
            if "density" in wanted:
                # an open mesh closes nothing whose volume could change
                swells = volume_of(points, self.surface) / volume_of(self.surface.points, self.surface)
                row["density"] = booked.mass / (swells if self._closed else 1.0)
        return row

    def _weighed(self, booked: Booked) -> dict[str, Any]:
        """Return what is wanted of where the weight is."""
        grams = booked.juice * self._params.weight
        radius = reference_radius(self._params, self._extent)
        found = {
            "water_lost": booked.evaporated,
            "mass": booked.mass,
            "juice_lost": booked.juice,
            "puddle": puddle_radius(grams, self._params.flesh.gravity) / radius,
            "respired": booked.respired,
        }
        return {name: value for name, value in found.items() if name in self._wanted}

    def follow(self, water: float, rot: Floats | None, held: Held | None, context: Context) -> None:
        """Settle a day of the march: later days, stages among them, start from its shape.

        Raises:
            NotConverged: body or skin found no equilibrium.

        """
        # nodes are evenly spaced: the last two say where the next one will be; a stage lies somewhere between
        found, _ = self._settled((water, rot, held), context, self._earlier)
        self._earlier, self._node = self._node, found

    def _settled(
        self, state: tuple[float, Floats | None, Held | None], context: Context, earlier: _Settled = _NONE
    ) -> tuple[_Settled, dict[str, Any]]:
        """Return the moved shape of a day, and what is kept of how it was found."""
        if self._body is None:
            return _Settled(None, None), {}
        watch, before = context.check_cancelled, self._node
        balance = self._body.settled(self._body.state(*state), before.balance, watch, earlier.balance)
        row: dict[str, Any] = {"body_residual": balance.residual, "body_steps": balance.steps}
        folds = None
        if self._wrinkles is not None and (self._wanted & BODY) - {"least_jacobian"}:
            folds = self._wrinkles.at(balance, before.folds, watch, earlier.folds)
            row["skin_residual"], row["skin_steps"] = folds.residual, folds.steps
        return _Settled(balance, folds), row

    def _dried(self, water: float, resolution: int, context: Context) -> Floats:
        return dried.displaced(self._params, water, resolution, context)

    def lost(self, day: float) -> float:
        """Return the water that a sound skin has lost by a day, over the fresh weight."""
        return water_lost(self._params, self._extent, day)


def volume_of(points: Floats, surface: Surface) -> float:
    """Return the volume [r1^3] within a surface whose points (v, 3) have moved."""
    # an imported mesh may be wound either way
    a, b, c = (points[surface.faces[:, k]] for k in range(3))
    return abs(float(np.sum(a * np.cross(b, c)))) / 6
