"""What a match says: where in the tables a target comes nearest, how near, and how sure that is."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

__all__ = ["Match", "MatchPage"]


class Match(BaseModel):
    """A shape of a table beside what was to be matched."""

    solver: str
    table: str
    parameters: dict[str, float] = Field(description="On the table's axes")
    symbol: str = Field(description="The stage axis")
    stage: float
    uncertainty: dict[str, float] = Field(
        description="Standard deviation of each, were the target's wrinkles those of another seed"
    )
    distance: float = Field(
        description="Root mean square of all differences over their scatter: 0 the same, 1 another seed's wrinkles"
    )
    parts: dict[str, float] = Field(description="The same by part: size, outline, spectrum, form, slopes, or by name")
    edges: list[str] = Field(description="What lies at the end of the table's range: the truth may lie beyond")
    link: str = Field(description="Address of the shape")
    command: str = Field(description="The command that writes it")


class MatchPage(BaseModel):
    """What comes nearest to a target."""

    generator: str
    target: dict[str, Any] = Field(description="What was read: its kind, its size")
    grade: str = Field(description="exact, near (as another seed's), similar, or far")
    unique: bool = Field(description="Nothing else in the tables is as near, within the scatter")
    advice: str = Field("", description="What to make of it, or to do")
    best: Match
    alternatives: list[Match] = Field(description="What else was found, the nearest first")
    looked_at: int = Field(description="Shapes that were looked at")
    tables: list[str] = Field(description="Tables that were searched")
    milliseconds: float
