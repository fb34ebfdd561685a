"""What of a run is wanted; nothing else is computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    field_validator,
    model_serializer,
)

from .errors import InvalidInput
from .words import advise, named, say

__all__ = ["Need", "Quality", "Region", "Start"]

Quality = Literal["preview", "default", "fine"]


class Region(BaseModel):
    """A patch of the surface, in degrees; only samples inside it are returned."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    colatitude: tuple[float, float] = Field((0.0, 180.0), description="From the pole y > 0 [degree]")
    azimuth: tuple[float, float] = Field(
        (0.0, 360.0),
        description="About the y axis, from x towards z [degree]; -40 to 40, or 320 to 400, is on both sides of 0",
    )

    @field_validator("colatitude", "azimuth")
    @classmethod
    def _ordered(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not value[0] < value[1]:
            raise ValueError("a range runs from a smaller to a larger angle")
        return value


class Start(BaseModel):
    """The shape that a run is not to find by itself but to start from: one of a table, which is only relaxed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    table: str = Field(min_length=1, max_length=100, description="Name of the table")
    digest: str = Field(min_length=1, max_length=100, description="Its generation, as GET /v1/tables says it")
    method: str = Field(min_length=1, max_length=100, description="How to look up in it")
    lattice: int | None = Field(
        None, ge=4, le=1024, description="Colatitudes of the lattice that is laid on the mesh; None is the table's own"
    )

    @model_serializer(mode="wrap")
    def _written(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out a lattice that is not there: keys of what was stored before there was one stay as they are."""
        written: dict[str, Any] = plain(self)
        if self.lattice is None:
            written.pop("lattice", None)
        return written


class Need(BaseModel):
    """What the asker wants to keep; a solver computes nothing else.

    An empty `fields` or `stages` stands for the solver's defaults; `Solver.settle` fills them in.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    fields: tuple[str, ...] = Field((), description="Names of the wanted variables")
    stages: tuple[float, ...] = Field((), description="Where on the stage axis to report; nothing beyond is solved")
    quality: Quality = Field("default", description="Mesh and step: preview, default or fine")
    tolerance: float | None = Field(
        None, gt=0, lt=1, description="Relative error asked for; picks the quality from the measured table"
    )
    resolution: int | None = Field(
        None, ge=4, le=1024, description="Colatitude samples of surface fields (azimuth has twice as many)"
    )
    region: Region | None = Field(None, description="Part of the surface to return; None is all of it")
    dtype: Literal["float32", "float64"] = Field("float32", description="Precision of the returned fields")
    start: Start | None = Field(None, description="Relax this looked-up shape, at one stage, instead of a run")

    @model_serializer(mode="wrap")
    def _written(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out a start that is not there: keys of what was stored before there was one stay as they are."""
        written: dict[str, Any] = plain(self)
        if self.start is None:
            written.pop("start", None)
        return written

    @field_validator("stages")
    @classmethod
    def _sorted(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(sorted(set(value)))

    @field_validator("fields")
    @classmethod
    def _distinct(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(sorted(set(value)))

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Validate `values`.

        Raises:
            InvalidInput: with one sentence per wrong value.

        """
        try:
            return cls.model_validate(dict(named(values)))
        except ValidationError as error:
            raise InvalidInput(f"{say(error, cls.model_fields)}.", advice=advise(error)) from None
