"""Where on a surface something holds: a share from 0 to 1 of each vertex, from its place on the shape."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from scipy.spatial import KDTree

from ...arrays import Floats
from ...contract import Context, InvalidInput
from ...contract.space import Position
from ..shapes import Ground
from .harmonic import harmonic
from .textures import UNMAPPED, Projection, gray_scott, laid

__all__ = [
    "Ball",
    "Band",
    "Everywhere",
    "Harmonic",
    "Lines",
    "Meridians",
    "Noise",
    "Painted",
    "Place",
    "Reaction",
    "Rim",
    "Texture",
    "anywhere",
    "check_mapped",
    "share",
]

Axis = Literal["x", "y", "z"]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Everywhere(_Model):
    """The whole surface."""

    kind: Literal["everywhere"] = "everywhere"


class Ball(_Model):
    """Near a point; fades to 0 at the radius."""

    kind: Literal["ball"] = "ball"
    centre: Position = Field(description="Centre [start shape's unit]")
    radius: float = Field(gt=0, le=100, description="Radius [start shape's unit]")


class Band(_Model):
    """From 0 at `low` to 1 at `high` of a coordinate, or of the distance from the z axis; low may be above high."""

    kind: Literal["band"] = "band"
    along: Literal["x", "y", "z", "radius"] = Field("z", description="Coordinate")
    low: float = Field(description="Where the share is 0 [start shape's unit]")
    high: float = Field(description="Where the share is 1 [start shape's unit]")


class Rim(_Model):
    """Near the border of an open surface; fades to 0 at the width."""

    kind: Literal["rim"] = "rim"
    width: float = Field(gt=0, le=100, description="Width [start shape's unit]")


class Meridians(_Model):
    """Everywhere but on lines that run from pole to pole about the z axis (the pumpkin's rigid lines)."""

    kind: Literal["meridians"] = "meridians"
    count: int = Field(8, ge=1, le=100, description="Number of lines")
    width: float = Field(0.15, gt=0, le=1, description="Half width of a line, over half the distance to the next")


class Noise(_Model):
    """Smooth random patches."""

    kind: Literal["noise"] = "noise"
    size: float = Field(0.3, gt=0.01, le=100, description="Size of the patches [start shape's unit]")
    sharpness: float = Field(2.0, ge=0.1, le=100, description="Slope of the step between bare and full")


class Painted(_Model):
    """Values of each vertex of the mesh as it is when the tool starts."""

    kind: Literal["painted"] = "painted"
    values: tuple[float, ...] = Field(max_length=200_000, description="Share of each vertex, 0 to 1 [1]")


_PROJECTED = "Axis of view, round about the z axis, sphere as maps of bodies are laid out, or uv, as the mesh says"
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Texture(_Model):
    """Values on a grid, laid on the surface by a map when the tool starts."""

    kind: Literal["texture"] = "texture"
    values: tuple[tuple[float, ...], ...] = Field(
        (), max_length=1024, description="Rows from below [1]", exclude_if=lambda value: not value
    )
    picture: tuple[tuple[Share, ...], ...] = Field(
        (),
        max_length=1024,
        description="Or rows from above, as of pictures: black 0, white 1 [1]",
        # runs without a picture keep their keys
        exclude_if=lambda value: not value,
    )
    projection: Projection = Field("z", description=_PROJECTED)

    @model_validator(mode="after")
    def _even(self) -> Self:
        if bool(self.values) == bool(self.picture):
            raise ValueError("a texture has either values or a picture")
        rows = self.values or self.picture
        if len(rows) < 2 or len(rows[0]) < 2 or any(len(row) != len(rows[0]) for row in rows):
            raise ValueError("the rows of a texture, two at least, are equally long, two values at least")
        return self

    @property
    def grid(self) -> Floats:
        """Its values (rows, columns), the first row low."""
        return np.array(self.values) if self.values else np.array(self.picture)[::-1]


class Reaction(_Model):
    """Spots and stripes of Gray and Scott's reaction-diffusion, laid on the surface as a texture."""

    kind: Literal["reaction"] = "reaction"
    feed: float = Field(0.035, ge=0, le=0.1, description="Feed rate F [1]")
    kill: float = Field(0.06, ge=0, le=0.1, description="Kill rate k [1]")
    size: int = Field(64, ge=16, le=256, description="Cells of the grid: more are finer")
    steps: int = Field(4000, ge=1, le=20_000, description="Steps of the reaction")
    projection: Projection = Field("z", description=_PROJECTED)


class Harmonic(_Model):
    """Shares painted at points, spread between them by Laplace's equation."""

    kind: Literal["harmonic"] = "harmonic"
    points: tuple[Position, ...] = Field(
        min_length=1, max_length=2000, description="Where; the nearest vertex [start shape's unit]"
    )
    values: tuple[float, ...] = Field(min_length=1, max_length=2000, description="Share of each point [1]")

    @model_validator(mode="after")
    def _matching(self) -> Self:
        if len(self.points) != len(self.values):
            raise ValueError("give one value for each point")
        return self


class Lines(_Model):
    """Along lines, such as the veins of a leaf; fades to 0 at the width."""

    kind: Literal["lines"] = "lines"
    lines: tuple[tuple[Position, ...], ...] = Field(
        min_length=1, max_length=200, description="Points of each line, straight between [start shape's unit]"
    )
    width: float = Field(gt=0, le=100, description="Half width [start shape's unit]")

    @field_validator("lines")
    @classmethod
    def _with_ends(cls, value: tuple[tuple[tuple[float, float, float], ...], ...]) -> object:
        if any(not 2 <= len(line) <= 500 for line in value):
            raise ValueError("a line has two points or more, 500 at most")
        return value


Place = Annotated[
    Everywhere | Ball | Band | Rim | Meridians | Lines | Noise | Painted | Texture | Reaction | Harmonic,
    Field(discriminator="kind"),
]


def _smooth(values: Floats | float) -> Floats:
    v = np.clip(np.asarray(values, float), 0, 1)
    found: Floats = v * v * (3 - 2 * v)
    return found


def _away(x: Floats, lines: Sequence[Sequence[tuple[float, float, float]]]) -> Floats:
    """Return how far points (n, 3) are from the nearest of lines."""
    found = np.full(len(x), np.inf)
    for line in lines:
        for tail, head in pairwise(np.array(line)):
            way = head - tail
            u = np.clip((x - tail) @ way / max(float(way @ way), 1e-300), 0, 1)
            found = np.minimum(found, np.linalg.norm(x - tail - u[:, None] * way, axis=1))
    return found


def check_mapped(value: object) -> None:
    """Refuse textures that lie by texture coordinates, in parameters of a surface that has none.

    Raises:
        ValueError: there is one.

    """
    if isinstance(value, Texture | Reaction) and value.projection == "uv":
        raise ValueError(f'a {value.kind} with projection = "uv" has no texture coordinates to lie by: {UNMAPPED}')
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            check_mapped(getattr(value, name))
    elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
        for each in value:
            check_mapped(each)


def anywhere(place: Place) -> bool:
    """Return whether a place's share is known at any point, and not at the vertices of a mesh alone."""
    if isinstance(place, Texture | Reaction):
        return place.projection != "uv"
    return not isinstance(place, Painted | Harmonic)


def share(place: Place, ground: Ground, seed: int, points: Floats | None = None) -> Floats:
    """Return the share (n,) of each vertex of a surface, or of each of its `points` (n, 3) if it is told `anywhere`.

    Raises:
        InvalidInput: a rim of a closed surface, painted values of another mesh, a texture that lies by coordinates
            which there are not.

    """
    x, border = ground.mesh.x if points is None else points, ground.border
    if isinstance(place, Ball):
        return _smooth(1 - np.asarray(np.linalg.norm(x - np.array(place.centre), axis=1)) / place.radius)
    if isinstance(place, Band):
        v = np.hypot(x[:, 0], x[:, 1]) if place.along == "radius" else x[:, "xyz".index(place.along)]
        span = place.high - place.low
        return _smooth(np.asarray((v - place.low) / (span if span else 1e-12)))
    if isinstance(place, Rim):
        if not len(border):
            raise InvalidInput("a closed surface has no rim.", advice="Start from a disc, a strip or a tube.")
        return _smooth(1 - KDTree(ground.mesh.x[border]).query(x)[0] / place.width)
    if isinstance(place, Meridians):
        turn = np.arctan2(x[:, 1], x[:, 0]) * place.count / (2 * np.pi)
        return _smooth(np.abs(turn - np.round(turn)) * 2 / place.width - 0.5)
    if isinstance(place, Lines):
        return _smooth(1 - _away(x, place.lines) / place.width)
    if isinstance(place, Noise):
        generator = Context.generator(seed)
        waves = generator.normal(size=(64, 3)) * 2 / place.size
        total = np.cos(x @ waves.T + generator.uniform(0, 2 * np.pi, 64)).sum(axis=1) / np.sqrt(32)
        return _smooth(0.5 + 0.5 * place.sharpness * total)
    if isinstance(place, Texture):
        return np.clip(laid(place.grid, ground, place.projection, points), 0, 1)
    if isinstance(place, Reaction):
        return laid(gray_scott(place.feed, place.kill, place.size, place.steps, seed), ground, place.projection, points)
    if isinstance(place, Harmonic):
        painted, first = np.unique(KDTree(x).query(np.array(place.points))[1], return_index=True)
        return np.clip(harmonic(x, ground.mesh.triangles, painted, np.array(place.values)[first]), 0, 1)
    if isinstance(place, Painted):
        if len(place.values) != len(x):
            raise InvalidInput(
                f"{len(place.values)} values are painted on {len(x)} vertices.", advice="Paint each vertex once."
            )
        found: Floats = np.clip(np.array(place.values, float), 0, 1)
        return found
    return np.ones(len(x))
