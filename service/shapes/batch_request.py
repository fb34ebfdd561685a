"""What a batch of shapes is asked with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..errors import InvalidQuery, Wrong
from . import detail
from .query import LOWEST_RESOLUTION

__all__ = ["BatchRequest", "counted", "expand"]

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Row = Annotated[dict[str, Number], Field(min_length=1)]
Column = Annotated[list[Number], Field(min_length=1)]
Columns = Annotated[dict[str, Column | Number], Field(min_length=1)]

_TEXT = detail.parameters()


class BatchRequest(BaseModel):
    """Many points and stages of one table, and one level of detail for all of them."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    solver: str = Field(description="Name of a solver; GET /v1/solvers lists them", examples=["dehydration"])
    table: str | None = Field(None, description="Name of the table; else the one that holds all points")
    preset: str | None = Field(None, description="Named parameters, for what the points do not say")
    points: Annotated[list[Row], Field(min_length=1)] | Columns = Field(
        description="One object per shape with the table's axes and the stage; or one list per name, all of one "
        "length, where a number stands for all shapes. `resolution`, or `screen_px` with `distance` and `fov`, may be "
        "a point's own (npz holds one lattice only)",
        examples=[
            [{"te": 0.035, "gamma": 20, "s": 0.1}, {"te": 0.035, "gamma": 20, "s": 0.2}],
            {"te": 0.035, "gamma": 20, "s": [0.1, 0.2]},
            {"te": 0.035, "gamma": 20, "s": 0.2, "screen_px": [400, 80]},
        ],
    )
    format: Literal["npz", "json", "glb", "obj", "points"] | None = Field(
        None, description="Representation; goes before the Accept header"
    )
    resolution: int | None = Field(
        None, ge=LOWEST_RESOLUTION, description="Colatitude samples; azimuth has twice as many"
    )
    screen_px: Positive | None = Field(None, description=_TEXT["screen_px"][0])
    distance: Positive | None = Field(None, description=_TEXT["distance"][0])
    fov: Annotated[Positive, Field(lt=180)] | None = Field(None, description=_TEXT["fov"][0])
    region: str | None = Field(None, description=_TEXT["region"][0], examples=["45:90,350:20"])
    fields: Annotated[list[Literal["position", "displacement"]], Field(min_length=1)] | None = Field(
        None, description="Fields of an npz; positions without it. With json, position measures the closed mesh"
    )
    components: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1)] | None = Field(
        None, description="Components of an npz's fields; the others are not computed"
    )
    method: str | None = Field(None, description="Method of look-up; the table's own without it")
    once: bool = Field(
        False,
        description="Send each distinct shape once: `row` of an npz, `points` of a line, the header `Wizen-Points` of "
        "a part say which points it is for. What is asked for twice is computed once in any case",
    )
    max_error: Positive | None = Field(None, description="Most that the roughness may be expected to be off by")

    @property
    def detail(self) -> dict[str, str]:
        """The level of detail, as a query string has it."""
        said = {name: getattr(self, name) for name in ("resolution", *detail.NAMES)}
        return {k: ",".join(v) if isinstance(v, list) else str(v) for k, v in said.items() if v is not None}


def counted(points: list[Row] | Columns) -> int:
    """Return how many shapes are asked for; of columns that are not of one length, as many as the longest says."""
    if isinstance(points, list):
        return len(points)
    return max((len(values) for values in points.values() if isinstance(values, list)), default=1)


def expand(points: list[Row] | Columns) -> list[Mapping[str, float]]:
    """Return one mapping per shape.

    Raises:
        InvalidQuery: columns are not of one length.

    """
    if isinstance(points, list):
        return list(points)
    lengths = {name: len(values) for name, values in points.items() if isinstance(values, list)}
    count = counted(points)
    short = [name for name, length in lengths.items() if length != count]
    if short:
        advice = "Give every list as many values as there are shapes; a single number stands for all."
        raise InvalidQuery.of([Wrong(f"points.{n}", f"has {lengths[n]} values, not {count}", advice) for n in short])
    columns = {name: values if isinstance(values, list) else [values] * count for name, values in points.items()}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
