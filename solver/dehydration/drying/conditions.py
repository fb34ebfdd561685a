"""Under which conditions a fruit dries."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Drying"]


def _units(units: str) -> dict[str, Any]:
    return {"units": units}


class Drying(BaseModel):
    """Conditions of drying; what is left out is what the measurements had, or is asked for where they need it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kinetics: Literal["grape", "jujube", "page"] | None = Field(
        None,
        description="Whose measurements: grapes in the open sun, whole jujubes in hot air, or Page's law with your own "
        "rate and exponent; without, those of the preset",
        json_schema_extra=_units("1"),
    )
    temperature: float | None = Field(None, description="Of the air", json_schema_extra=_units("degC"))
    humidity: Annotated[float, Field(ge=0, lt=100)] | None = Field(
        None, description="Relative humidity of the air", json_schema_extra=_units("%")
    )
    air_speed: Annotated[float, Field(ge=0)] | None = Field(
        None, description="Speed of the air past the fruits", json_schema_extra=_units("m s-1")
    )
    diameter: Annotated[float, Field(ge=1, le=1000)] | None = Field(
        None, description="Diameter of the fresh fruit as a sphere", json_schema_extra=_units("mm")
    )
    moisture: Annotated[float, Field(ge=0.5, le=0.95)] | None = Field(
        None, description="Water in the fresh flesh over its mass", json_schema_extra=_units("1")
    )
    rate: Annotated[float, Field(gt=0)] | None = Field(
        None, description="k of Page's law MR = exp(-k t^n), t in hours", json_schema_extra=_units("h-n")
    )
    exponent: Annotated[float, Field(gt=0, le=3)] = Field(
        1.0, description="n of Page's law", json_schema_extra=_units("1")
    )
