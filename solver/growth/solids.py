"""Solids that a growing surface cannot enter, at rest or moving: planes, balls, boxes and closed meshes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..arrays import Floats
from ..contract.mesh import ClosedMesh
from ..contract.space import Direction, Position
from .shapes import Mesh, is_closed

if TYPE_CHECKING:
    from ..geometry.signed import Signed

__all__ = ["Plane", "Solid", "SolidBall", "SolidBox", "SolidMesh", "check_outside", "check_pace", "present"]

#: Vertices by which it is told first whether a sheet is inside a solid.
_LOOKED_AT = 1000

Side = Annotated[float, Field(gt=0, le=100)]
Speed = Annotated[float, Field(ge=-100, le=100)]
Point = tuple[float, float, float]
Place = Annotated[float, Field(ge=-100, le=100)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _sum(a: Point, b: Point) -> Point:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


class _Solid(_Model):
    #: The field that says where it is, which moves.
    place: ClassVar[str] = "centre"

    start: float = Field(0.0, ge=0, le=1000, description="From when it is there [growth time]")
    duration: float = Field(1000.0, gt=0, le=1000, description="How long it is there [growth time]")
    velocity: tuple[Speed, Speed, Speed] = Field(
        (0.0, 0.0, 0.0), description="How it moves from its start on [start shape's unit per growth time]"
    )

    def moved(self, time: float) -> tuple[float, float, float]:
        """Return how far it has come by a growth time."""
        x, y, z = ((time - self.start) * v for v in self.velocity)
        return (x, y, z)

    def at(self, time: float) -> Self:
        """Return it where it is at a growth time."""
        return self.model_copy(update={self.place: _sum(getattr(self, self.place), self.moved(time))})


class Plane(_Solid):
    """A half-space that the surface cannot enter."""

    place: ClassVar[str] = "point"

    kind: Literal["plane"] = "plane"
    point: Position = Field((0.0, 0.0, 0.0), description="A point of the plane [start shape's unit]")
    normal: Direction = Field((0.0, 0.0, 1.0), description="Out of the solid [1]")

    @property
    def thick(self) -> float:
        """How deep its middle lies at least: it has none."""
        return math.inf

    def depth(self, x: Floats) -> tuple[Floats, Floats]:
        """Return how deep points (n, 3) are in it (n,), 0 outside, and the way out (n, 3), along its normal."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        return np.maximum((np.array(self.point) - x) @ normal, 0.0), np.broadcast_to(normal, x.shape)


class SolidBall(_Solid):
    """A ball that the surface cannot enter."""

    kind: Literal["ball"] = "ball"
    centre: Position = Field((0.0, 0.0, 0.0), description="Centre [start shape's unit]")
    radius: float = Field(1.0, gt=0, le=100, description="Radius [start shape's unit]")

    @property
    def thick(self) -> float:
        """How deep its middle lies at least."""
        return self.radius

    def depth(self, x: Floats) -> tuple[Floats, Floats]:
        """Return depths (n,) and ways out (n, 3) of points (n, 3), away from its centre."""
        way = x - np.array(self.centre)
        distance = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
        return np.maximum(self.radius - distance, 0.0), way / distance[:, None]


class SolidBox(_Solid):
    """A box with rounded edges, its sides along the axes, that the surface cannot enter."""

    kind: Literal["box"] = "box"
    centre: Position = Field((0.0, 0.0, 0.0), description="Centre [start shape's unit]")
    size: tuple[Side, Side, Side] = Field(
        (1.0, 1.0, 1.0), description="Length along x, y and z, edges included [start shape's unit]"
    )
    edge: float = Field(0.1, ge=0, le=100, description="Radius of its edges, half a side at most [start shape's unit]")

    @property
    def thick(self) -> float:
        """How deep its middle lies at least."""
        return min(self.size) / 2

    def depth(self, x: Floats) -> tuple[Floats, Floats]:
        """Return depths (n,) and ways out (n, 3) of points (n, 3): of a side, an edge or a corner."""
        way = x - np.array(self.centre)
        signs = np.where(way < 0, -1.0, 1.0)
        # how far beyond the box without its rounding: outside of that the nearest point is on it, inside a side is
        beyond = np.abs(way) - (np.array(self.size) / 2 - self.edge)
        outside = np.maximum(beyond, 0.0)
        away = np.linalg.norm(outside, axis=1)
        nearest = np.eye(3)[np.argmax(beyond, axis=1)]
        depth = self.edge - np.where(away > 0, away, beyond.max(axis=1))
        normal = np.where(away[:, None] > 0, outside / np.maximum(away, 1e-300)[:, None], nearest)
        return np.maximum(depth, 0.0), signs * normal

    @model_validator(mode="after")
    def _round(self) -> Self:
        if 2 * self.edge > min(self.size):
            raise ValueError(f"edges of radius {self.edge:g} do not fit a box of size {self.size}; half a side at most")
        return self


class SolidShape(ClosedMesh):
    """A closed triangle mesh around the place that `centre` tells of."""

    points: tuple[tuple[Place, Place, Place], ...] = Field(
        min_length=4, max_length=20_000, description="Vertices [start shape's unit]"
    )
    faces: tuple[tuple[int, int, int], ...] = Field(
        min_length=4, max_length=40_000, description="Triangles, counter-clockwise from outside, vertices from 0"
    )

    @cached_property
    def signed(self) -> Signed:
        """What tells how deep points are in it."""
        # parameters and schemas are read without what compiles
        from ..geometry.signed import Signed

        return Signed(np.array(self.points), np.array(self.faces, np.int64))


class SolidMesh(_Solid):
    """A closed triangle mesh that the surface's vertices cannot enter: what is finer than its edges pokes through."""

    kind: Literal["mesh"] = "mesh"
    mesh: SolidShape = Field(description="Points and triangles")
    centre: Position = Field((0.0, 0.0, 0.0), description="Where the mesh's origin is [start shape's unit]")

    @cached_property
    def thick(self) -> float:
        """How deep its middle lies at least, but for thin edges and tips."""
        return self.mesh.signed.thick()

    def depth(self, x: Floats) -> tuple[Floats, Floats]:
        """Return depths (n,) and ways out (n, 3) of points (n, 3), to the nearest place of the mesh."""
        way, signed = x - np.array(self.centre), self.mesh.signed
        # only what is in the box about it can be in it
        near = ((way > signed.low) & (way < signed.high)).all(axis=1)
        depth, out = np.zeros(len(way)), np.tile([0.0, 0.0, 1.0], (len(way), 1))
        found, out[near] = signed.depth(way[near])
        depth[near] = np.maximum(found, 0.0)
        return depth, out


Solid = Annotated[Plane | SolidBall | SolidBox | SolidMesh, Field(discriminator="kind")]


def present(solids: Iterable[Solid], time: float) -> tuple[Solid, ...]:
    """Return the solids that are there at the end of a step, where they are then; one that starts with the step is."""
    there = (s for s in solids if (s.start < time - 1e-9 or not s.start) and time <= s.start + s.duration + 1e-9)
    return tuple(s.at(time) if any(s.velocity) else s for s in there)


def check_pace(solid: Solid, step: float) -> None:
    """Refuse a solid that would pass through the sheet between two equilibria.

    Raises:
        ValueError: it moves by more than half the way to its middle.

    """
    way = step * math.hypot(*solid.velocity)
    if way > 0 and way > solid.thick / 2:
        raise ValueError(
            f"a {solid.kind} moves by {way:.3g} in a step of {step:g}, and could pass through the sheet: its middle is "
            f"{solid.thick:g} deep, and half of that is the most; take a shorter step, or let it move more slowly"
        )


def check_outside(called: str, solid: Solid, sheet: Mesh, thickness: float) -> None:
    """Refuse a solid that a whole open sheet lies in, deeper than it is thick; called: as its asker knows it.

    What lies in it by less than it is thick is laid on it; what is closed is stretched over what is in it.

    Raises:
        ValueError: all of the sheet is inside.

    """
    # of most meshes one of some vertices is outside
    if solid.depth(sheet.x[:: len(sheet.x) // _LOOKED_AT + 1])[0].min() <= thickness:
        return
    depth = solid.depth(sheet.x)[0]
    if depth.min() > thickness and not is_closed(sheet.triangles):
        raise ValueError(
            f"the sheet begins wholly inside {called}, a {solid.kind}: all of it is "
            f"{depth.min():.3g} deep or deeper, {depth.max():.3g} at most; move the solid off the sheet, "
            "make it smaller, or give it a later `start`"
        )
