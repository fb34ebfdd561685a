"""Rigid bodies as parameters: their shapes, their ways, and those that move freely."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..contract.mesh import ClosedMesh

__all__ = ["Body", "Metres", "Newtons", "Part", "Rate", "Solid", "Turn", "Vector", "Waypoint", "half_width"]

Metres = Annotated[float, Field(ge=-10, le=10)]
Vector = tuple[Metres, Metres, Metres]
Rate = tuple[
    Annotated[float, Field(ge=-100, le=100)],
    Annotated[float, Field(ge=-100, le=100)],
    Annotated[float, Field(ge=-100, le=100)],
]
Turn = Annotated[float, Field(ge=-100, le=100)]
Newtons = Annotated[float, Field(ge=-1e7, le=1e7)]
Spin = Annotated[float, Field(ge=-1e4, le=1e4)]
_TURN = "axis times angle, right-handed [radian]"


class Part(BaseModel):
    """Base of what a set-up is made of."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Waypoint(Part):
    """Where a body is at a time; between two of them it moves and turns evenly."""

    time: float = Field(ge=0, le=1000, description="Time [s]")
    position: Vector = Field(description="Place of its pivot, by default its centre, of a wedge its edge's middle [m]")
    turn: tuple[Turn, Turn, Turn] = Field(
        (0.0, 0.0, 0.0),
        description=f"How it is turned about its pivot: {_TURN}. Between turns about one axis it turns by their "
        "difference, also more than once round; between others the shortest way",
    )


class Solid(ClosedMesh):
    """A closed triangle mesh in a body's frame, convex or not."""

    points: tuple[Vector, ...] = Field(min_length=4, max_length=20_000, description="Vertices in the body's frame [m]")
    faces: tuple[tuple[int, int, int], ...] = Field(
        min_length=4, max_length=40_000, description="Triangles, counter-clockwise from outside, vertices from 0"
    )


def half_width(height: float, angle: float, edge: float) -> float:
    """Return half the thickness [m] that a wedge's bevels reach at its back."""
    sine, cosine = math.sin(angle / 2), math.cos(angle / 2)
    return (edge + (height - edge) * sine) / cosine


class Body(Part):
    """A rigid body: on a given path, or, with a mass, thrown, dropped or guided."""

    shape: Literal["box", "cylinder", "ball", "wedge", "mesh"] = Field("box", description="Shape")
    size: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0),
        description="Sides of a box along x, y, z; diameter, length and 0 of a cylinder; diameter, 0 and 0 of a ball; "
        "of a wedge, whose edge runs along y and points to -z, thickness (0: what its angle gives at the back; less "
        "makes a blade with a bevel), length of the edge, and height from edge to back; of a mesh 0 [m]",
    )
    axis: Literal["x", "y", "z"] = Field("y", description="Axis of a cylinder")
    angle: float = Field(
        0.5, gt=0, lt=math.pi, description="Angle between a wedge's two sides, or of a blade's bevel [radian]"
    )
    edge: float = Field(5e-4, gt=0, le=1, description="Radius of a wedge's edge [m]")
    mesh: Solid | None = Field(None, description="Points and triangles of a mesh")
    path: tuple[Waypoint, ...] = Field(
        min_length=1, max_length=64, description="Its way; it rests before and after. With a mass: where it begins"
    )
    pivot: Vector | None = Field(
        None,
        description="Place in its own frame that is where the path says and that it turns about; by default its "
        "centre, of a wedge its edge's middle, of a mesh its points' origin [m]",
    )
    friction: float = Field(0.3, ge=0, le=2, description="Coulomb friction with the rods [1]")
    mass: float | None = Field(
        None,
        gt=0,
        le=1e6,
        description="Mass, evenly spread, of a body that moves freely from the one place of its path on; without, it "
        "goes its path whatever the force. It is never scaled [kg]",
    )
    velocity: Rate = Field((0.0, 0.0, 0.0), description="Velocity of its centre of mass at time 0 [m/s]")
    spin: tuple[Spin, Spin, Spin] = Field((0.0, 0.0, 0.0), description="Angular velocity at time 0 [radian/s]")
    guide: Vector | None = Field(
        None, description="Direction of a line along which it slides without turning, as a ram does; of any length [1]"
    )
    force: tuple[Newtons, Newtons, Newtons] = Field(
        (0.0, 0.0, 0.0), description="Steady force on its centre of mass, besides its weight [N]"
    )

    @model_validator(mode="after")
    def _sound(self) -> Self:
        self._shaped()
        if any(a.time >= b.time for a, b in pairwise(self.path)):
            raise ValueError("the times of the path must rise: sort them, and give each once")
        if self.mass is None:
            if any(self.velocity) or any(self.spin) or any(self.force) or self.guide is not None:
                raise ValueError("velocity, spin, force and guide are of bodies that move freely: give it a mass")
            return self
        if len(self.path) > 1 or self.path[0].time > 0:
            raise ValueError(
                "a body with a mass moves freely from time 0 on, and follows no path: give one place at time 0 and a "
                "velocity, or leave the mass out"
            )
        if self.pivot is not None:
            raise ValueError("a body with a mass turns about its centre of mass: leave the pivot out")
        if self.guide is not None:
            self._guided(self.guide)
        return self

    def _shaped(self) -> None:
        if (self.shape == "mesh") != (self.mesh is not None):
            raise ValueError("a shape of mesh needs points and triangles as `mesh`, and no other shape has them")
        first = {"box": 0, "cylinder": 0, "ball": 0, "wedge": 1, "mesh": 3}[self.shape]
        last = {"box": 3, "cylinder": 2, "ball": 1, "wedge": 3, "mesh": 3}[self.shape]
        if min((*self.size[first:last], 1.0)) <= 0:
            raise ValueError("sides, diameter and length must be positive")
        if self.shape == "wedge":
            reached = 2 * half_width(self.size[2], self.angle, self.edge)
            if self.size[2] <= 2 * self.edge:
                raise ValueError("the wedge's edge is rounder than it is high: take a smaller edge or a greater height")
            if self.size[0] != 0 and not 2 * self.edge < self.size[0] <= reached * (1 + 1e-9):
                raise ValueError(
                    f"a wedge of this height and angle is between {2 * self.edge:.3g} m (its edge) and {reached:.3g} m "
                    "thick: take a thickness between, 0 for the most, or another angle"
                )

    def _guided(self, guide: Vector) -> None:
        length = math.hypot(*guide)
        if length == 0:
            raise ValueError("the guide has no direction: give one, or leave it out")
        if any(self.spin):
            raise ValueError("a guided body does not turn: leave spin or guide out")
        along = sum(g * v for g, v in zip(guide, self.velocity, strict=True)) / length
        if math.dist(self.velocity, [along * g / length for g in guide]) > 1e-6 * math.hypot(*self.velocity):
            raise ValueError("a guided body moves along its guide: let the velocity be along it")
