"""What may be done to a growing shell while it grows."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..solids import Solid
from ..tooling.tools import Kernel, Point, Stretch, Tool

__all__ = ["ACTIONS", "Add", "Brush", "End", "Lift", "Put"]


class _Action(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Brush(_Action):
    """A dab of the brush. Dabs until the brush is lifted, or until it is another brush, are one stroke."""

    at: Point = Field(description="Where; the nearest point of the surface [start shape's unit]")
    way: Point | None = Field(None, description="Direction of the brush; none: from the dab before [1]")
    radius: float = Field(0.3, gt=0, le=100, description="Radius of influence [start shape's unit]")
    stretch: tuple[Stretch, Stretch] = Field((1.3, 1.3), description="Along and across the way, per unit time [1]")
    thickening: Stretch = Field(
        1.0, description="Through the sheet: what its thickness is multiplied by, per unit time [1]"
    )
    kernel: Kernel = Field("smooth", description="(1 - r^2)^2, 1 or 1 - r inside the radius")
    hold: float | None = Field(None, gt=0, le=1000, description="How long it acts; none: one step [growth time]")


class Lift(_Action):
    """The brush leaves the surface."""


class Add(_Action):
    """A tool as a parameter file has it; it starts with the next step, or later where it says so."""

    tool: Tool = Field(description="Hot spot, curve, surface or stroke")


class Put(_Action):
    """A solid that the surface cannot enter, from the next step on or later."""

    solid: Solid = Field(description="Plane, ball or box")


class End(_Action):
    """A tool or a solid ends with the next step."""

    tool: int | None = Field(None, ge=0, description="Number of the tool")
    solid: int | None = Field(None, ge=0, description="Or of the solid")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.tool is None) == (self.solid is None):
            raise ValueError("name either a tool or a solid by its number")
        return self


ACTIONS: Mapping[str, type[BaseModel]] = MappingProxyType(
    {"brush": Brush, "lift": Lift, "add": Add, "solid": Put, "end": End}
)
