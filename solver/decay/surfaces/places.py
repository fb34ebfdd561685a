"""Places on a fruit that a user points at: by angles, or by a position."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ...contract.space import Position
from ...painted import PaintedMap

__all__ = ["Neighbour", "Place", "Pressure", "PressureMap", "Wound"]


class Place(BaseModel):
    """A disc on the skin; `position` may be given in place of the angles: any point above the place."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    colatitude: float = Field(ge=0, le=180, description="From the pole y > 0 [degree]")
    azimuth: float = Field(0.0, ge=0, le=360, description="About the y axis, from x towards z [degree]")
    radius: float = Field(0.12, ge=0.01, le=0.6, description="Radius [r1]")

    @model_validator(mode="before")
    @classmethod
    def _pointed_at(cls, value: Any) -> Any:
        if not isinstance(value, dict) or "position" not in value:
            return value
        rest = {k: v for k, v in value.items() if k != "position"}
        if {"colatitude", "azimuth"} & set(rest):
            raise ValueError("give a position or angles, not both")
        point = np.asarray(value["position"], dtype=float)
        if point.shape != (3,) or not np.isfinite(point).all() or not point.any():
            raise ValueError("a position is three numbers, and not the fruit's centre")
        down = np.degrees(np.arccos(np.clip(point[1] / np.linalg.norm(point), -1, 1)))
        around = np.degrees(np.arctan2(point[2], point[0])) % 360
        return {**rest, "colatitude": float(down), "azimuth": float(around)}


class Wound(Place):
    """A place where rot and mould enter on day 0; on an imported mesh `vertex` may be given in place of the angles."""

    vertex: int | None = Field(None, ge=0, description="Number of a vertex of the imported mesh")

    @model_validator(mode="before")
    @classmethod
    def _numbered(cls, value: Any) -> Any:
        if not isinstance(value, dict) or value.get("vertex") is None:
            return value
        if "position" in value:
            raise ValueError("give a position or a vertex, not both")
        return {"colatitude": 0.0, **value}


class Pressure(Place):
    """A pressure point: how much stiffer and longer the flesh is in a ball about a place of the skin."""

    stiffness: float = Field(1.0, ge=0.01, le=100, description="Stiffness at the place, over what it would be [1]")
    length: float = Field(1.0, ge=0.5, le=1.5, description="Rest length at the place, over what it would be [1]")


class PressureMap(PaintedMap):
    """A painted pressure map: where it is 1, stiffness and rest length are multiplied; it fades out with depth."""

    stiffness: float = Field(
        1.0, ge=0.01, le=100, description="Stiffness where the map is 1, over what it would be [1]"
    )
    length: float = Field(1.0, ge=0.5, le=1.5, description="Rest length where the map is 1, over what it would be [1]")
    depth: float = Field(0.5, gt=0, le=3, description="Depth at which the map has faded out [r1]")


class Neighbour(BaseModel):
    """A round fruit beside this one."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    position: Position = Field(description="Its centre, from this fruit's [r1]")
    radius: float = Field(1.0, gt=0, le=100, description="Its radius [r1]")
    gives: bool = Field(
        False,
        description="Whether it gives way as this fruit does: bodies then meet in the plane midway between "
        "their skins, as two alike do; else it is a rigid ball",
    )
