"""What the catalogue's pages hold: the index, the service's health, tables and solvers."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

__all__ = ["Health", "Index", "SolverList", "SolverPage", "TableList", "TablePage"]


class FormatEntry(BaseModel):
    """A representation that may be asked for."""

    media_type: str
    title: str


class Index(BaseModel):
    """Where to go from here."""

    name: str = Field(description="wizen")
    version: str
    links: dict[str, str] = Field(description="Addresses; what stands in braces is to be filled in")
    formats: dict[str, FormatEntry] = Field(description="Formats of one shape")
    result_formats: dict[str, FormatEntry] = Field(description="Formats of a job's result")


class TableHealth(BaseModel):
    """A table that can be read."""

    digest: str = Field(description="Names the generation that is served")
    samples: int
    complaint: str | None = Field(None, description="What is wrong with a newer generation, which is not served")


class Health(BaseModel):
    """All is well."""

    status: str = Field(description="ok")
    version: str
    tables: dict[str, TableHealth]


class Attributes(BaseModel):
    """What a quantity is."""

    units: str
    long_name: str
    symbol: str


class TableAxis(BaseModel):
    """A parameter that varies over a table's runs."""

    lowest: float
    highest: float
    units: str
    description: str


class TableStage(BaseModel):
    """The stages that a table holds."""

    symbol: str = Field(description="Name of the stage in a query")
    long_name: str
    units: str
    lowest: float
    highest: float
    stored: list[float] = Field(description="Stages of the runs; between them is interpolated")
    neighbour_correlation: list[float | None] | None = Field(
        description="By stored stage, how far neighbouring runs agree on the places of their wrinkles; null: not known"
    )


class TableMethods(BaseModel):
    """How a table may be looked up."""

    default: str
    known: list[str]
    judged: str | None = Field(description="The method whose errors the table knows")


class TablePage(BaseModel):
    """A table that shapes can be asked of; a damaged one has `complaint` and its name alone."""

    name: str
    complaint: str | None = Field(None, description="What is wrong with it; the other fields are missing then")
    solver: str | None = None
    solver_version: str | None = None
    digest: str | None = Field(None, description="Names the generation")
    created: str | None = Field(None, description="When it was built (UTC)")
    samples: int | None = Field(None, description="Runs that it was built of")
    resolution: int | None = Field(None, description="Colatitude samples of its own lattice")
    max_resolution: int | None = Field(None, description="Most colatitude samples that may be asked for")
    dtype: str | None = None
    axes: dict[str, TableAxis] | None = None
    fixed: dict[str, Any] | None = Field(None, description="Parameters that are the same for all runs")
    stage: TableStage | None = None
    methods: TableMethods | None = None
    descriptors: dict[str, Attributes] | None = None
    links: dict[str, str] | None = None


class TableList(BaseModel):
    """All tables."""

    tables: list[TablePage]


class SolverEntry(BaseModel):
    """A solver in the list."""

    name: str
    title: str
    advance: str = Field(description="The word for going along its stages, e.g. Dry")
    href: str


class SolverList(BaseModel):
    """All solvers."""

    solvers: list[SolverEntry]


class Axis(BaseModel):
    """A parameter of one value; bounds and default are missing where there are none."""

    description: str
    units: str
    lowest: float | None = None
    highest: float | None = None
    default: float | None = None


class StageAxis(BaseModel):
    """What a solver's stages are."""

    symbol: str
    long_name: str
    units: str
    lowest: float
    highest: float
    default: list[float] = Field(description="Stages of a run that names none")


class Quality(BaseModel):
    """What a quality gives."""

    relative_error: float | None = Field(description="As measured; null where it never was")
    resolution: int | None = Field(description="Colatitude samples of its lattice, where it has one")


class SessionPage(BaseModel):
    """A live engine (docs/sessions.md)."""

    address: str = Field(description="WebSocket")
    actions: dict[str, dict[str, Any]] = Field(description="JSON schema of what goes with each action")
    fields: list[str] = Field(description="What may be shown beside the shape")


class Portrait(BaseModel):
    """A picture of a preset that comes with wizen."""

    href: str = Field(description="PNG")
    version: str = Field(description="Version of the solver that it was drawn of")
    quality: str
    stage: float


class SolverPage(BaseModel):
    """A solver: what it takes and what it gives."""

    name: str
    version: str
    title: str
    params: dict[str, Any] = Field(description="JSON schema of its parameters")
    axes: dict[str, Axis] = Field(description="Parameters of one value, as they are queried and swept")
    stages: StageAxis
    fields: dict[str, Attributes]
    default_fields: list[str]
    presets: dict[str, dict[str, Any]]
    preset_stages: dict[str, list[float]]
    portraits: dict[str, Portrait] = Field(description="Pictures by preset, of those that have one")
    sizes: dict[str, float] = Field(description="Length of r1 by preset [m]; none where any size is right")
    looks: dict[str, Any] = Field(description="Colours by field, and labels and places for a page")
    qualities: dict[str, Quality]
    session: SessionPage | None = Field(None, description="Where and how it is worked on live, if it can be")
    links: dict[str, str]
