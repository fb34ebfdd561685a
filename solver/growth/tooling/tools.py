"""Tools as data: hot spots, hot curves and hot surfaces (Combaz and Neyret 2004, chapter 4).

Stretches are factors by which lengths grow in a unit of growth time at full intensity: the square roots of the
paper's expansion rates D1 and D2. 1 is no growth, less than 1 is shrinking. Where several tools act, logarithms add.
"""

from __future__ import annotations

from itertools import accumulate, pairwise
from string import ascii_uppercase
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from ...arrays import Floats
from ...contract.space import Direction, Position
from .places import Everywhere, Place

__all__ = [
    "Apex",
    "HotCurve",
    "HotSpot",
    "HotStroke",
    "HotSurface",
    "HotTensors",
    "Kernel",
    "PaintedStroke",
    "Point",
    "Stretch",
    "Tool",
    "clocked",
    "intensities",
]

#: Control points of a curve that is made about an apex.
_AROUND = 24

Stretch = Annotated[float, Field(ge=0.1, le=10)]
Point = Position
Kernel = Literal["smooth", "flat", "cone"]
Way = Literal["space", "surface"]
_HOW_FAR = "How far is measured: through space, as far as the surface leads there, or along the surface"


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
    kernel: Kernel = Field("smooth", description="(1 - r^2)^2, 1 or 1 - r inside the radius")
    distance: Way = Field("space", description=_HOW_FAR)
    stretch: tuple[Stretch, Stretch] = Field((1.3, 1.3), description="Along and across the frame [1]")
    frame: Direction = Field(
        (1.0, 0.0, 0.0), description="Direction of the first stretch, as projected on the surface [1]"
    )
    polar: bool = Field(
        False, description="Stretches away from the spot and around it, in place of along and across the frame [1]"
    )
    angle: float = Field(0.0, ge=-360, le=360, description="Turns the frame about the normal [degree]")
    turning: float = Field(0.0, ge=-3600, le=3600, description="Turning of the frame [degree per growth time]")
    splits: tuple[float, ...] = Field(
        (), max_length=6, description="When every spot splits, after the start [growth time]"
    )
    branches: int = Field(2, ge=2, le=6, description="Spots that one splits into")
    spread: float = Field(0.6, gt=0, le=1, description="Distance of the new spots from the old one, over its radius")
    shrink: float = Field(0.75, gt=0, le=1, description="Radius of the new spots over that of the old one")
    axiom: str = Field("A", min_length=1, max_length=1, description="Letter of the first spot, for `rules`")
    rules: dict[str, tuple[str, ...]] = Field(
        {},
        max_length=26,
        description="What each letter becomes when spots split, one of several by chance: letters are spots, f steps "
        "on, + and - turn, ! shrinks, [ and ] keep and take back the place",
    )
    turn: float = Field(60.0, ge=-360, le=360, description="Angle of + and - in the rules [degree]")
    resting: str = Field("", max_length=26, description="Letters of spots that do not grow")

    @field_validator("rules")
    @classmethod
    def _spelt(cls, value: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        for letter, words in value.items():
            for word in words:
                if not set(word) <= set(ascii_uppercase + "f+-![]") or len(word) > 200:
                    raise ValueError(f"the rule of {letter!r} has signs other than capitals and f+-![]: {word[:40]!r}")
                depths = list(accumulate((sign == "[") - (sign == "]") for sign in word))
                if any(depth < 0 for depth in depths) or (depths and depths[-1]):
                    raise ValueError(f"the brackets of the rule of {letter!r} do not match: {word[:40]!r}")
            if not words or letter not in ascii_uppercase or len(letter) != 1:
                raise ValueError(f"a rule is of a capital and gives something, not {letter[:10]!r}")
        return value


class Apex(BaseModel):
    """A curve about a place, made when its tool starts: an arc of a circle on the surface."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    at: Point | None = Field(None, description="Middle; the nearest point of the surface [start shape's unit]")
    tool: int | None = Field(None, ge=0, le=199, description="Or the number, from 0, of the hot spot to follow")
    radius: float = Field(0.3, gt=0, le=100, description="Distance from the middle [start shape's unit]")
    across: bool = Field(False, description="A line through the middle in place of a circle")
    frame: Direction = Field(
        (1.0, 0.0, 0.0), description="Direction in which it begins, as projected on the surface [1]"
    )
    arc: float = Field(360.0, gt=0, le=360, description="Part of the circle [degree]")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.at is None) == (self.tool is None):
            raise ValueError("give either a point or a hot spot's number")
        return self


class HotCurve(_Tool):
    """A line on the surface that grows along itself and outwards."""

    kind: Literal["curve"] = "curve"
    points: tuple[Point, ...] = Field((), max_length=500, description="Control points [start shape's unit]")
    apex: Apex | None = Field(None, description="In place of control points: made about an apex when it starts")
    closed: bool = Field(False, description="Whether the last point meets the first")
    radius: float = Field(0.2, gt=0, le=100, description="Radius of influence [start shape's unit]")
    distance: Way = Field("space", description=_HOW_FAR)
    stretch: tuple[Stretch, Stretch] = Field((1.0, 1.3), description="Tangential and normal to the curve [1]")
    normalised: float = Field(
        0.0, ge=-5, le=5, description="Share lambda of the tangential growth that keeps the outgrowth flat (1: a plane)"
    )
    intensities: tuple[float, ...] = Field((), max_length=500, description="Intensity at each control point [1]")
    delay: float = Field(0.0, ge=0, le=1000, description="From its making, when it is attached, to its growing [time]")
    offsets: tuple[float, ...] = Field((), max_length=500, description="Later start of each control point [time]")
    paces: tuple[float, ...] = Field((), max_length=500, description="Pace of the activation at each control point [1]")

    @model_validator(mode="after")
    def _matching(self) -> Self:
        if (self.apex is None) == (len(self.points) < 2):
            raise ValueError("give either two points or more, or an apex")
        count = len(self.points) if self.apex is None else _AROUND
        for name in ("intensities", "offsets", "paces"):
            if getattr(self, name) and len(getattr(self, name)) != count:
                raise ValueError(f"{name}: give one for each control point ({count}), or none")
        return self


class HotSurface(_Tool):
    """A part of the surface that grows; its shares are taken when it starts and stay with the material."""

    kind: Literal["surface"] = "surface"
    where: Place = Field(description="Share of each vertex")
    stretch: tuple[Stretch, Stretch] = Field((1.2, 1.2), description="Along and across the frame [1]")
    frame: Direction | Literal["around"] = Field(
        "around", description="Direction of the first stretch, projected on the surface; 'around' the z axis [1]"
    )
    offset: float = Field(0.0, ge=0, le=1000, description="Later start where `later` is 1 [time]")
    later: Place | None = Field(None, description="Share of `offset` of each vertex")
    pace: float = Field(1.0, gt=0, le=100, description="Pace of the activation where `paced` is 1 [1]")
    paced: Place | None = Field(None, description="How much of `pace` each vertex has, of its logarithm")
    curl: tuple[float, float] = Field(
        (0.0, 0.0), description="Rest curvature added along and across, in unit time [1/start shape's unit]"
    )


class HotStroke(_Tool):
    """A brush that is drawn over the surface: dabs that grow along its way, one after the other."""

    kind: Literal["stroke"] = "stroke"
    points: tuple[Point, ...] = Field(
        min_length=1, max_length=20_000, description="Dabs; the nearest points of the surface [start shape's unit]"
    )
    ways: tuple[Point, ...] = Field(
        (), max_length=20_000, description="Direction of the brush at each dab; none, or 0: the same all round [1]"
    )
    times: tuple[float, ...] = Field(
        (), max_length=20_000, description="When each dab is laid, after the start, rising; none: all at once [time]"
    )
    hold: float = Field(1000.0, gt=0, le=1000, description="How long each dab acts; half a step at least [growth time]")
    radius: float = Field(0.3, gt=0, le=100, description="Radius of influence [start shape's unit]")
    kernel: Kernel = Field("smooth", description="(1 - r^2)^2, 1 or 1 - r inside the radius")
    distance: Way = Field("space", description=_HOW_FAR)
    stretch: tuple[Stretch, Stretch] = Field((1.3, 1.3), description="Along and across the way of the brush [1]")
    thickening: Stretch = Field(
        1.0,
        description="Through the sheet: what its thickness is multiplied by; it stays within .05 and 20 times [1]",
        # runs whose strokes thicken nothing keep their keys
        exclude_if=lambda value: value == 1,
    )

    @model_validator(mode="after")
    def _matching(self) -> Self:
        for name in ("ways", "times"):
            if getattr(self, name) and len(getattr(self, name)) != len(self.points):
                raise ValueError(f"{name}: give one for each dab ({len(self.points)}), or none")
        if any(a > b for a, b in pairwise(self.times)):
            raise ValueError("the times of a stroke must not fall")
        return self

    def laid(self, dab: int) -> float:
        """Return when a dab is laid [growth time]."""
        return self.start + (self.times[dab] if self.times else 0.0)


class PaintedStroke(BaseModel):
    """A stroke that says how what lies under it grows."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    points: tuple[Point, ...] = Field(
        min_length=1, max_length=500, description="Its way, straight between; the nearest vertices [start shape's unit]"
    )
    width: float = Field(0.0, ge=0, le=100, description="Half width; 0: the nearest vertices [start shape's unit]")
    stretch: tuple[Stretch, Stretch] = Field((1.0, 1.0), description="Along and across the frame [1]")
    frame: Direction | Literal["along", "around"] = Field(
        "along",
        description="Direction of the first stretch: 'along' the stroke, 'around' the z axis, or a direction [1]",
    )


class HotTensors(_Tool):
    """A surface whose growth is painted by strokes, and spread between them by Laplace's equation, as tensors."""

    kind: Literal["tensors"] = "tensors"
    strokes: tuple[PaintedStroke, ...] = Field(
        min_length=1, max_length=200, description="What is painted; where strokes meet, the last holds"
    )
    where: Place = Field(Everywhere(), description="Share of each vertex")


def clocked(tool: Tool) -> bool:
    """Return whether places of a tool have clocks of their own."""
    if isinstance(tool, HotCurve):
        return bool(tool.offsets or tool.paces)
    return isinstance(tool, HotSurface) and (tool.later is not None or tool.paced is not None)


Tool = Annotated[HotSpot | HotCurve | HotSurface | HotStroke | HotTensors, Field(discriminator="kind")]


def intensities(tool: Tool, since: Floats) -> Floats:
    """Return the intensities at times since the start, of places with clocks of their own; 0 outside the duration."""
    when, value = np.array(tool.activation).T
    return np.where((since >= 0) & (since < tool.duration), np.interp(since, when, value), 0.0)
