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


class Triangles(BaseModel):
    """Which points make a triangle: only with these do `crossings` and `volume` hold. Counter-clockwise from outside.

    A corner [i, j] lies i rows south and j columns east of a point. Columns go on at 0 after the last; point (i, j) of
    n rows of 2n is vertex 2n i + j, the north pole 2n^2, the south pole 2n^2 + 1.
    """

    quads: list[list[list[int]]] = Field(
        description="The two triangles of each quad, from its point in the north-west: of every row but the last"
    )
    fans: list[list[str | list[int]]] = Field(
        description="The triangle with the north pole, from a point of the first row, and the one with the south pole, "
        "from a point of the last; none in a part of the surface"
    )


class Lattice(BaseModel):
    """How many samples the surface has, and how they are joined."""

    colatitude: int
    azimuth: int
    triangles: Triangles


class ShapePage(BaseModel):
    """The numbers about a shape, with links to the files that hold it."""

    generator: str
    solver: str
    table: str = Field(description="The table that it was looked up in, or relaxed from; empty of a run")
    digest: str = Field(description="Names the table's generation, or a run's result")
    params: dict[str, Any] = Field(description="All numbers: those asked for, and what the table or the run holds")
    made: dict[str, Any] | None = Field(None, description="How its runs were done where that is not the usual")
    stage: ShapeStage
    exact: bool = Field(description="A stored run at a stored stage, or the fresh shape")
    converged: bool = Field(description="All runs that took part did converge")
    crossings: int | None = Field(
        description="Pairs of the lattice's triangles that cross; null where no positions were computed, as they are "
        "for JSON with `fields=position` only"
    )
    volume: float | None = Field(
        description="Inside the closed mesh of the lattice's triangles [r1^3]; null where no positions were computed"
    )
    tier: str = Field(
        description="How it came about: looked up in a `table`, `relaxed` from there by its solver, or a `run`"
    )
    nearest: float | None = Field(
        description="Distance to the nearest run; 1 is a whole range of a parameter; null of a shape that was relaxed "
        "from a table that is no longer there"
    )
    inside: bool = Field(description="The runs surround the question")
    held: float | None = Field(
        description="Share of the wrinkles' height (rms) that a lattice as fine as this one holds at least; null where "
        "the table does not say. What it lacks is no error in `expected_error`"
    )
    expected_error: dict[str, float | None] | None = Field(description="By measure; null where nobody knows")
    method: str = Field(description="Of the look-up; empty of a run")
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
