"""The grammar of a scene: what may stand in a scene file or in the body of `POST /v1/scenes`."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from solver.contract import Quality

from ..errors import Wrong
from .errors import InvalidScene, SceneTooLarge
from .ground import Ground

__all__ = ["FORMATS", "MOST", "Budget", "Camera", "Item", "Place", "Scene", "Transform", "parse"]

#: Name -> media type and suffix.
FORMATS = {
    "glb": ("model/gltf-binary", ".glb"),
    "usdc": ("model/vnd.usd", ".usdc"),
    "usda": ("model/vnd.usda", ".usda"),
    "json": ("application/json", ".json"),
}
#: Most instances of one scene; one that is parsed in full before it is refused would cost what it asks for.
MOST = 20_000
#: Most items with an entry of their own.
MOST_ITEMS = 20_000
#: When a curve ends at the latest [s]: what counts frames, or seconds in single precision, knows no later time.
_LAST = 1e9

Vector = tuple[float, float, float]
Etag = Annotated[str, Field(pattern="^[0-9a-f]{16}$")]
Length = Annotated[float, Field(gt=0, le=1e6)]
#: The kind of what is found wrong with a size.
_SIZE = "size"


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Camera(_Strict):
    """A pinhole camera; lengths in the scene's unit."""

    position: Vector = Field(description="The eye")
    target: Vector = Field((0.0, 0.0, 0.0), description="What it looks at")
    up: Vector = Field((0.0, 1.0, 0.0), description="What is up in the picture")
    fov: float = Field(40.0, gt=0, lt=180, description="Vertical angle of view [degree]")
    width: int = Field(1280, ge=1, le=16384, description="Width of the picture [pixel]")
    height: int = Field(720, ge=1, le=16384, description="Height of the picture [pixel]")

    @model_validator(mode="after")
    def _looks(self) -> Self:
        forward = [t - p for t, p in zip(self.target, self.position, strict=True)]
        reach, tall = math.hypot(*forward), math.hypot(*self.up)
        if reach < 1e-9:
            raise ValueError("the camera stands on its target: move position or target")
        aligned = abs(sum(f * u for f, u in zip(forward, self.up, strict=True)))
        if tall < 1e-9 or aligned > (1 - 1e-9) * reach * tall:
            raise ValueError("up points along the line of sight: take another up, as [0, 0, 1]")
        return self


class Place(_Strict):
    """A rule that places all items which name it, in the order of the items.

    row: along x. scatter: on a square of the floor, or standing on a mesh along its normals, apart from each other.
    bowl: poured into a bowl whose lowest inner point is `at`. pile: poured onto the floor.
    """

    name: str = Field("", max_length=40, description="What items call it")
    rule: Literal["row", "scatter", "bowl", "pile"] = Field(description="How items are placed")
    at: Vector = Field((0.0, 0.0, 0.0), description="Its middle, on the floor [scene unit]")
    radius: Length | None = Field(None, description="bowl: inner radius. scatter: half the side. [scene unit]")
    mesh: Ground | None = Field(None, description="scatter: what they stand on, in place of the floor, moved by `at`")
    gap: float = Field(0.2, ge=0, le=1e6, description="row: between neighbours [scene unit]")
    seed: int = Field(0, ge=0, le=2**32 - 1, description="Of the places and of how things fall")


class Transform(_Strict):
    """Where one instance is."""

    position: Vector = Field((0.0, 0.0, 0.0), description="[scene unit]")
    rotation: tuple[float, float, float, float] = Field((0.0, 0.0, 0.0, 1.0), description="Quaternion x, y, z, w")
    scale: Length = Field(1.0, description="Over the item's size")

    @field_validator("rotation")
    @classmethod
    def _turns(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if math.hypot(*value) < 1e-6:
            raise ValueError("a quaternion of length 0 turns nothing: write [0, 0, 0, 1]")
        return value


class Item(_Strict):
    """Things of one kind: a preset and/or parameters at one stage, of a table or a stored run, or such a run by key."""

    solver: str | None = Field(
        None, description="Whose shapes; none: of the one that has the preset, or that the tables are of"
    )
    preset: str | None = Field(None, description="A fruit by its name; `wizen presets` lists them")
    parameters: dict[str, Any] = Field(
        {}, description="Over the preset's: numbers by axis, and of runs all that jobs take"
    )
    run: str | None = Field(
        None,
        pattern="^[0-9a-fA-F]{4,64}$",
        description="A stored run by its key or the beginning of it, in place of solver, preset and parameters",
    )
    source: Literal["table", "run"] | None = Field(
        None, description="Whether a table or a stored run; none: a table where the solver has tables"
    )
    quality: Quality | None = Field(None, description="Of a run; none: the best that is stored, else default")
    stage: float | None = Field(
        None, description="Stage, as the solver counts them; or a curve instead; of a run by key, none is the last one"
    )
    curve: tuple[tuple[float, float], ...] = Field(
        (), max_length=64, description="Stages over time: pairs of seconds and stage, at least two, times rising from 0"
    )
    name: str = Field("", max_length=80, description="What the report calls it")
    size: Length | Literal["real"] | None = Field(
        None,
        union_mode="left_to_right",
        description="Length of r1, or of a run's own unit [scene unit]; real: as large as such things are. None: 1 for "
        "tables, for runs their real size where it is known, else 1",
    )
    count: int = Field(1, ge=1, description="How many individuals")
    seed: int | None = Field(None, ge=0, le=2**32 - 1, description="Turns and mirrors the individuals; none: as stored")
    vary: float = Field(0.0, ge=0, le=0.5, description="Share by which sizes of individuals differ; needs a seed")
    differ: float = Field(
        0.0,
        ge=0,
        le=0.5,
        description="Of tables: share by which stage and axes differ between individuals, never out of what the table "
        "holds; needs a seed",
    )
    shapes: int = Field(6, ge=1, le=64, description="With differ: how many shapes the individuals share")
    variants: tuple[float, ...] = Field(
        (), max_length=16, description="usd: other stages, which the prototype's variant set `stage` offers"
    )
    shade: str | None = Field(None, description="The skin, as the solver names it; the preset's, if not given")
    full: bool = Field(
        False,
        description="Of runs: what stands on the skin too, where anything does: stem and calyx, threads of mould; with "
        "one stage, not with a curve",
    )
    place: str | None = Field(None, description="The place that holds it")
    transforms: tuple[Transform, ...] = Field((), description="Where the individuals are, instead of a place")

    @field_validator("size", mode="wrap")
    @classmethod
    def _sized(cls, value: Any, check: ValidatorFunctionWrapHandler) -> Any:
        """Say in one sentence what neither a length nor a word fits."""
        try:
            return check(value)
        except ValidationError:
            said = 'a size is a length above 0 and of 1000000 at most, or the word "real"'
            raise PydanticCustomError(_SIZE, said) from None

    @model_validator(mode="after")
    def _stands(self) -> Self:
        if self.run is not None:
            self._named()
        elif (self.stage is None) == (not self.curve):
            raise ValueError("an item has either a stage or a curve of stages: write one of them")
        if not _finite(self.parameters):
            raise ValueError("parameters are finite numbers")
        # what most items have not is asked for first: a scene may have thousands
        if self.curve:
            self._lasts()
        if self.transforms and self.place is not None:
            raise ValueError("transforms and place exclude each other: keep one of them")
        if self.transforms and self.count not in (1, len(self.transforms)):
            raise ValueError(f"count is {self.count}, and there are {len(self.transforms)} transforms: leave out count")
        if self.seed is None and (self.vary or self.differ):
            raise ValueError(f"{'vary' if self.vary else 'differ'} needs a seed")
        if self.variants and not all(map(math.isfinite, self.variants)):
            raise ValueError("variants are finite numbers")
        return self

    def _lasts(self) -> None:
        """Check an item with a curve of stages."""
        times = [at for at, _ in self.curve]
        if len(times) < 2 or times[0] < 0 or any(b <= a for a, b in pairwise(times)):
            raise ValueError("a curve has two or more pairs [seconds, stage], and its times rise, from 0 or later")
        if times[-1] > _LAST:
            raise ValueError(f"a curve ends within {_LAST:g} seconds: take another unit of time")
        if self.variants:
            raise ValueError("variants and a curve exclude each other: keep one of them")
        if self.full:
            raise ValueError("threads grow, so that full and a curve exclude each other: keep one of them")

    def _named(self) -> None:
        """Check an item that names a run."""
        if self.solver or self.preset or self.parameters or self.quality:
            raise ValueError("run names all of a run: leave out solver, preset, parameters and quality")
        if self.source == "table":
            raise ValueError("run names a stored run, which no table holds: leave out source")
        if self.stage is not None and self.curve:
            raise ValueError("an item has either a stage or a curve of stages: write one of them")

    @property
    def first(self) -> float:
        """The stage to begin with."""
        if self.stage is not None:
            return self.stage
        return self.curve[0][1]

    @property
    def stages(self) -> tuple[float, ...]:
        """All stages, in the order of the curve; none where a run's last one is meant."""
        return tuple(stage for _, stage in self.curve) or (() if self.stage is None else (self.stage,))

    @property
    def instances(self) -> int:
        """Number of individuals."""
        return len(self.transforms) or self.count


def _finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:  # numbers without a call each
            if not (math.isfinite(one) if isinstance(one, float) else _finite(one)):
                return False
    return True


class Budget(_Strict):
    """What the file may cost; what is not named is free."""

    bytes: int | None = Field(None, ge=1, description="Size of the file [byte]")
    triangles: int | None = Field(None, ge=1, description="Triangles drawn, over all instances")
    milliseconds: float | None = Field(None, gt=0, description="Expected processor time of the look-ups [ms]")


class Scene(_Strict):
    """A scene: a camera, items, the places that hold them, a budget."""

    camera: Camera
    items: tuple[Item, ...] = Field(min_length=1)
    places: tuple[Place, ...] = Field((), max_length=100)
    budget: Budget = Field(default_factory=Budget)
    unit: float = Field(1.0, gt=0, le=1e3, description="Length of the scene's unit [m]")
    props: bool = Field(True, description="Bowls and meshes that things stand on are in the file too")
    cull: bool = Field(True, description="Leave out what the camera does not see")
    known: tuple[Etag, ...] = Field(
        (), max_length=20_000, description="glb: etags of meshes that the asker has; they are named and not sent"
    )

    @model_validator(mode="after")
    def _placed(self) -> Self:
        names = [place.name for place in self.places]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"several places are called {', '.join(map(repr, sorted(twice)))}: name each of its own")
        for i, item in enumerate(self.items):
            if item.place is not None and item.place not in names:
                known = ", ".join(map(repr, names)) or "none"
                raise ValueError(f"items.{i}.place: there is no place {item.place!r}: known are {known}")
            if item.place is None and item.instances > 1 and not item.transforms:
                raise ValueError(
                    f"items.{i}: {item.count} individuals need a place or transforms, or stand in each other"
                )
        for i, place in enumerate(self.places):
            if place.mesh is not None and place.rule != "scatter":
                raise ValueError(f"places.{i}: a {place.rule} has no mesh: leave it out, or take the rule scatter")
            if place.rule in ("bowl", "scatter") and place.radius is None and place.mesh is None:
                more = " or a mesh" if place.rule == "scatter" else ""
                raise ValueError(f"places.{i}: a {place.rule} needs a radius{more}")
            if place.radius is not None and place.mesh is not None:
                raise ValueError(f"places.{i}: radius and mesh exclude each other: keep one of them")
        return self


def parse(values: Any) -> Scene:
    """Return a scene of plain values.

    Raises:
        SceneTooLarge: it has more instances than `MOST`; said before anything else is read.
        InvalidScene: listing all that is wrong.

    """
    if not isinstance(values, dict):
        raise InvalidScene.of([Wrong("scene", "is no object", "Write camera and items.")])
    _check_count(values.get("items"))
    try:
        scene = Scene.model_validate(values)
    except ValidationError as error:
        wrong = []
        for item in _causes(error)[:50]:
            name = ".".join(str(part) for part in item["loc"]) or "scene"
            detail = str(item["msg"]).removeprefix("Value error, ")
            given = item.get("input")
            shown = f" (got {given!r})" if isinstance(given, str | int | float) else ""
            wrong.append(Wrong(name, f"{detail}{shown}"[:400], _advice(item["type"])))
        raise InvalidScene.of(wrong) from None
    # numbers come as 1e9 or as text as well, and transforms count themselves
    _check_total(sum(item.instances for item in scene.items))
    return scene


def _causes(error: ValidationError) -> list[Any]:
    """Return what is wrong, without lists that are too short only because an entry of theirs is wrong."""
    found = error.errors(include_url=False)
    places = [item["loc"] for item in found]

    def is_followed(loc: tuple[int | str, ...]) -> bool:
        return any(len(place) > len(loc) and place[: len(loc)] == loc for place in places)

    return [item for item in found if item["type"] != "too_short" or not is_followed(item["loc"])]


def _check_count(items: Any) -> None:
    """Refuse a scene by the number of its instances alone."""
    if not isinstance(items, list | tuple):
        return
    counts = [item.get("count", 1) for item in items[: MOST_ITEMS + 1] if isinstance(item, dict)]
    total = len(items) + sum(max(0, c - 1) for c in counts if isinstance(c, int) and not isinstance(c, bool))
    _check_total(total)


def _check_total(total: int) -> None:
    if total > MOST:
        advice = f"Send at most {MOST}: split the scene, or leave out what is far away."
        raise SceneTooLarge.of([Wrong("items", f"{total} instances are more than {MOST}", advice)])


def _advice(kind: str) -> str:
    return {
        "extra_forbidden": "Leave it out; the documentation lists what there is.",
        "missing": "Add it.",
        "finite_number": "Take finite numbers.",
        _SIZE: 'Write size = 2.5, or size = "real".',
    }.get(kind, "")
