"""Tools as data: hot spots, hot curves and hot surfaces (Combaz and Neyret 2004, chapter 4).

Stretches are factors by which lengths grow in a unit of growth time at full intensity: the square roots of the
paper's expansion rates D1 and D2. 1 is no growth, less than 1 is shrinking. Where several tools act, logarithms add.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from .places import Place

__all__ = ["HotCurve", "HotSpot", "HotSurface", "Tool", "intensity"]

Stretch = Annotated[float, Field(ge=0.1, le=10)]
Point = tuple[float, float, float]


class _Tool(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    start: float = Field(0.0, ge=0, le=1000, description="When it starts [growth time]")
    duration: float = Field(1000.0, gt=0, le=1000, description="How long it acts [growth time]")
    activation: tuple[tuple[float, float], ...] = Field(
        ((0.0, 1.0),),
        min_length=1,
        max_length=200,
        description="Intensity in time, pairs (time after the start, intensity), linear between [growth time, 1]",
    )

    @field_validator("activation")
    @classmethod
    def _rising(cls, value: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if any(a[0] >= b[0] for a, b in pairwise(value)):
            raise ValueError("the times of an activation must rise")
        return value


class HotSpot(_Tool):
    """A point that grows its surroundings and rides on them."""

    kind: Literal["spot"] = "spot"
    at: Point = Field(description="Where, the nearest point of the surface [start shape's unit]")
    radius: float = Field(0.4, gt=0, le=100, description="Radius of influence [start shape's unit]")
    kernel: Literal["smooth", "flat", "cone"] = Field("smooth", description="(1 - r^2)^2, 1 or 1 - r inside the radius")
    stretch: tuple[Stretch, Stretch] = Field((1.3, 1.3), description="Along and across the frame [1]")
    frame: Point = Field((1.0, 0.0, 0.0), description="Direction of the first stretch, as projected on the surface [1]")
    angle: float = Field(0.0, ge=-360, le=360, description="Turns the frame about the normal [degree]")
    turning: float = Field(0.0, ge=-3600, le=3600, description="Turning of the frame [degree per growth time]")
    splits: tuple[float, ...] = Field(
        (), max_length=6, description="When every spot splits, after the start [growth time]"
    )
    branches: int = Field(2, ge=2, le=6, description="Spots that one splits into")
    spread: float = Field(0.6, gt=0, le=1, description="Distance of the new spots from the old one, over its radius")
    shrink: float = Field(0.75, gt=0, le=1, description="Radius of the new spots over that of the old one")


class HotCurve(_Tool):
    """A line on the surface that grows along itself and outwards."""

    kind: Literal["curve"] = "curve"
    points: tuple[Point, ...] = Field(min_length=2, max_length=500, description="Control points [start shape's unit]")
    closed: bool = Field(False, description="Whether the last point meets the first")
    radius: float = Field(0.2, gt=0, le=100, description="Radius of influence [start shape's unit]")
    stretch: tuple[Stretch, Stretch] = Field((1.0, 1.3), description="Tangential and normal to the curve [1]")
    normalised: float = Field(
        0.0, ge=-5, le=5, description="Share lambda of the tangential growth that keeps the outgrowth flat (1: a plane)"
    )
    intensities: tuple[float, ...] = Field((), max_length=500, description="Intensity at each control point [1]")

    @model_validator(mode="after")
    def _matching(self) -> Self:
        if self.intensities and len(self.intensities) != len(self.points):
            raise ValueError("give one intensity for each control point, or none")
        return self


class HotSurface(_Tool):
    """A part of the surface that grows; its shares are taken when it starts and stay with the material."""

    kind: Literal["surface"] = "surface"
    where: Place = Field(description="Share of each vertex")
    stretch: tuple[Stretch, Stretch] = Field((1.2, 1.2), description="Along and across the frame [1]")
    frame: Point | Literal["around"] = Field(
        "around", description="Direction of the first stretch, projected on the surface; 'around' the z axis [1]"
    )
    curl: tuple[float, float] = Field(
        (0.0, 0.0), description="Rest curvature added along and across, in unit time [1/start shape's unit]"
    )


Tool = Annotated[HotSpot | HotCurve | HotSurface, Field(discriminator="kind")]


def intensity(tool: HotSpot | HotCurve | HotSurface, time: float) -> float:
    """Return the intensity of a tool at a growth time, 0 outside its duration."""
    since = time - tool.start
    if not 0 <= since < tool.duration:
        return 0.0
    when, value = np.array(tool.activation).T
    return float(np.interp(since, when, value))
