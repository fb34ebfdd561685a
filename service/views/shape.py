"""The numbers about a shape, and fields of a result, as JSON has them."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

__all__ = ["FieldsPage", "ShapePage"]


class ShapeStage(BaseModel):
    """Where on the stage axis a shape is."""

    symbol: str
    value: float


class Descriptor(BaseModel):
    """One number about a shape."""

    value: float | None = Field(description="Null where the table does not know it")
    units: str
    long_name: str


class Lattice(BaseModel):
    """How many samples the surface has."""

    colatitude: int
    azimuth: int


class ShapePage(BaseModel):
    """The numbers about a shape, with links to the files that hold it."""

    generator: str
    solver: str
    table: str
    digest: str = Field(description="Names the table's generation")
    params: dict[str, Any] = Field(description="All parameters: those asked for, and what the table holds fixed")
    made: dict[str, Any] | None = Field(None, description="How its runs were done where that is not the usual")
    stage: ShapeStage
    exact: bool = Field(description="A stored run at a stored stage, or the fresh shape")
    converged: bool = Field(description="All runs that took part did converge")
    crossings: int | None = Field(description="Pairs of triangles that cross; null where no positions were computed")
    tier: str = Field(
        description="How it came about: looked up in a `table`, `relaxed` from there by its solver, or a `run`"
    )
    nearest: float = Field(description="Distance to the nearest run; 1 is a whole range of a parameter")
    inside: bool = Field(description="The runs surround the question")
    expected_error: dict[str, float | None] | None = Field(description="By measure; null where nobody knows")
    method: str
    units: dict[str, str]
    detail: dict[str, Any] | None = Field(None, description="What was chosen of resolution, part and fields")
    lattice: Lattice
    descriptors: dict[str, Descriptor] = Field(
        description="Numbers of the stored runs, weighted; not measured on the shape that is handed over"
    )
    weights: dict[str, float] = Field(description="The runs that took part, by key")
    timings_ms: dict[str, float]
    links: dict[str, str] = Field(description="Addresses of the files that hold the shape")


class ResultField(BaseModel):
    """One field of a result."""

    dims: list[str]
    shape: list[int]
    units: str
    long_name: str
    values: Any = Field(description="Nested lists, one level for each dimension")


class FieldsPage(BaseModel):
    """Named fields of a result."""

    solver: str
    solver_version: str
    params: dict[str, Any]
    need: dict[str, Any]
    known: list[str] = Field(description="All fields that the result has")
    fields: dict[str, ResultField]
