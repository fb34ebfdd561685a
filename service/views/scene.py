"""What a scene's report says."""

from __future__ import annotations

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


class SceneItem(BaseModel):
    """What was done about an item."""

    name: str
    table: str
    instances: int
    shown: int
    computed: list[int] = Field(description="Lattices that were looked up for this item first")
    shared: int = Field(description="Individuals that use a mesh that is there already")
    reduced: int = Field(description="Individuals that are coarser than the screen asks for")
    skipped: dict[str, int] = Field(description="Individuals that were left out, by why")
    lattices: dict[str, int] = Field(description="Individuals by colatitudes")
    milliseconds_saved: float = Field(description="Look-ups that a request for each would have taken, less those made")
    expected_error: dict[str, float] | None = Field(None, description="By measure; null where nobody knows")
    exact: bool | None = Field(None, description="A stored run at a stored stage, or the fresh shape")
    converged: bool | None = Field(None, description="All runs that took part did converge")


class ScenePage(BaseModel):
    """What became of a scene: what was computed, shared, reduced and left out."""

    generator: str
    instances: int
    shown: int
    left_out: dict[str, int] = Field(description="Individuals that were left out, by why")
    kinds: int = Field(description="Distinct fruits and stages")
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
