"""What a scene's report says."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

__all__ = ["ScenePage"]


class ScenePlace(BaseModel):
    """How a pile or a bowl came to rest."""

    still: bool = Field(description="Everything lies still")
    speed: float = Field(description="The fastest, as it was left [scene unit of fall per step]")


class SceneDetail(BaseModel):
    """How fine the shapes are."""

    share: float = Field(description="1 where the budget took nothing away from what the screen asks for")
    lattices: list[int] = Field(description="Colatitudes that were used")


class SceneMissing(BaseModel):
    """A run that is not stored, and in whose place something plain stands."""

    key: str = Field(description="Under which it will be stored: the id of its job")
    job: dict[str, Any] | None = Field(
        description="Its job's id, state and progress (0 to 1); null where there is none"
    )
    why: str
    advice: str


class SceneItem(BaseModel):
    """What was done about an item."""

    name: str
    table: str | None = Field(None, description="The table that answers; what follows to `box` is of runs alone")
    run: str | None = Field(None, description="Key of the stored run")
    placeholder: str | None = Field(None, description="What stands in for a run that is not stored")
    missing: SceneMissing | None = Field(None, description="Why it is not; the item's own stage, else a variant")
    solver: str | None = None
    symbol: str | None = Field(None, description="What the solver calls its stages")
    stages: list[float] | None = None
    shade: str | None = None
    full: bool | None = Field(None, description="What stands on the run's skin is there too")
    sides: list[float] | None = Field(None, description="Of a placeholder, along x, y and z [its unit]")
    metres_per_unit: float | None = Field(None, description="Length of the run's unit [m]; null where nobody knows")
    box: list[list[float]] | None = Field(None, description="Least and largest coordinates, unturned [its unit]")
    instances: int
    shown: int
    computed: list[int] = Field(
        description="Lattices that were looked up for this item first; of a report alone, those that a file takes"
    )
    shared: int = Field(description="Individuals that use a mesh that is there already")
    reduced: int = Field(description="Individuals that are coarser than the screen asks for")
    skipped: dict[str, int] = Field(description="Individuals that were left out, by why")
    lattices: dict[str, int] = Field(
        description="Individuals by colatitudes n; a mesh of its own has at most some 4 n^2 triangles"
    )
    coarsened: dict[str, float] | None = Field(
        None, description="How far meshes of runs are off the run's own, over its size, by n"
    )
    variants: list[str] | None = Field(None, description="Other stages that USD files offer, in the item's order")
    shapes: int | None = Field(None, description="Of an item whose individuals differ: how many shapes are in sight")
    milliseconds_saved: float = Field(description="Look-ups that a request for each would have taken, less those made")
    expected_error: dict[str, float] | None = Field(
        None, description="By measure, of the worst of its stages and shapes; null where nobody knows"
    )
    exact: bool | None = Field(
        None, description="A stored run at a stored stage, or the fresh shape; on a curve at all of its stages"
    )
    converged: bool | None = Field(None, description="All runs that took part did converge")


class ScenePage(BaseModel):
    """What became of a scene: what was computed, shared, reduced and left out."""

    generator: str
    instances: int
    shown: int
    left_out: dict[str, int] = Field(description="Individuals that were left out, by why")
    kinds: int = Field(description="Distinct fruits and stages")
    missing: int = Field(description="Of these, those of runs that are not stored: something plain stands in for them")
    meshes: int = Field(description="Distinct meshes")
    triangles: int = Field(description="Triangles drawn, over all individuals")
    bytes: int = Field(description="Size of the file; 0 where only the report was asked for")
    bytes_expected: int
    compressed: bool
    detail: SceneDetail
    milliseconds: dict[str, float] = Field(description="Time spent, by part [ms]")
    milliseconds_saved: float
    places: dict[str, ScenePlace]
    items: list[SceneItem]
