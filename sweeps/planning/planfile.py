"""The grammar of a plan file: what may stand in the TOML, with the nearest name for what may not."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Strict, Tag, ValidationError, model_validator

from ..errors import PlanError

__all__ = ["Axis", "Pattern", "PlanFile", "Range", "Sampling", "load", "parse", "suggest"]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Range(_Strict):
    """`{from = 0.01, to = 0.04, count = 4}`: values from one end to the other, both included."""

    start: float = Field(alias="from", description="First value")
    to: float = Field(description="Last value")
    count: int | None = Field(None, ge=2, description="Number of values; not needed for Sobol sampling")
    scale: Literal["linear", "log"] = Field("linear", description="Equal steps, or equal ratios")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.start < self.to:
            raise ValueError(f"a range runs from a smaller to a larger value, not from {self.start:g} to {self.to:g}")
        if self.scale == "log" and self.start <= 0:
            raise ValueError("a logarithmic range starts above zero")
        return self


def _tag(value: Any) -> str:
    return "range" if isinstance(value, Mapping | Range) else "list"


#: The values of one swept name. The tags keep a wrong list from being reported as a wrong range as well.
Axis = Annotated[
    Annotated[Range, Tag("range")] | Annotated[tuple[Annotated[float, Strict()], ...], Tag("list")],
    Discriminator(_tag),
]


class Sampling(_Strict):
    """How the axes are filled: every combination, a Sobol sequence, or the listed samples."""

    kind: Literal["grid", "sobol", "list"] = Field("grid", description="grid, sobol or list")
    count: int | None = Field(None, ge=1, description="Number of Sobol samples (a power of 2 fills the space best)")
    seed: int = Field(0, ge=0, description="Seed of the Sobol scrambling; more samples keep the earlier ones")
    skip_invalid: bool = Field(
        False,
        description="Pass over impossible combinations instead of refusing the plan; Sobol goes on to its count",
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.kind == "sobol" and self.count is None:
            raise ValueError('kind = "sobol" needs a count')
        if self.kind != "sobol" and (self.count is not None or "seed" in self.model_fields_set):
            raise ValueError('count and seed belong to kind = "sobol"')
        return self


class Pattern(_Strict):
    """The sample that runs first, and whose wrinkles at one stage all others start from."""

    sample: dict[str, Any] = Field(description="Its values of the swept names")
    stage: float = Field(description="Stage whose wrinkles are taken: soon after the onset")
    amplitude: float = Field(0.2, description="Their largest height in the others, in exocarp thicknesses")
    controls: tuple[dict[str, Any], ...] = Field((), description="Samples that are run without it as well")


class PlanFile(_Strict):
    """A plan as it is written; `sweeps.planning.plan.Plan` is what it means."""

    solver: str = Field(description="Name of the solver")
    preset: str | None = Field(None, description="Named parameters to start from")
    name: str | None = Field(None, description="Name of the plan in the ledger; the file's name if not given")
    set: dict[str, Any] = Field(default_factory=dict, description="Values that all samples share")
    axes: dict[str, Axis] = Field(default_factory=dict, description="Values that are swept")
    sampling: Sampling = Field(default_factory=Sampling, description="How the axes are filled")
    samples: tuple[dict[str, Any], ...] = Field((), description='The samples of kind = "list"')
    pattern: Pattern | None = Field(None, description="A run that all samples start from, so that they buckle alike")
    need: dict[str, Any] = Field(default_factory=dict, description="What to compute: stages, quality, fields, ...")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.sampling.kind == "list":
            if not self.samples:
                raise ValueError('kind = "list" needs at least one [[samples]] table')
            if self.axes:
                raise ValueError('kind = "list" takes its values from [[samples]]; remove [axes]')
        elif self.samples:
            raise ValueError('[[samples]] need kind = "list" under [sampling]')
        elif self.sampling.kind == "sobol" and not self.axes:
            raise ValueError('kind = "sobol" needs [axes] to sample')
        for name, axis in self.axes.items():
            if isinstance(axis, tuple) and not axis:
                raise ValueError(f"axis {name} has no values")
            if self.sampling.kind == "grid" and isinstance(axis, Range) and axis.count is None:
                raise ValueError(f"axis {name}: a range needs a count in a grid")
            if self.sampling.kind == "sobol" and isinstance(axis, tuple) and len(set(axis)) < 2:
                raise ValueError(f"axis {name}: Sobol sampling needs two ends; put a single value under [set]")
        return self


def load(path: Path) -> tuple[dict[str, Any], str]:
    """Return the tables of a TOML file, and its text, which a pipe gives once.

    Raises:
        PlanError: no such file, or no TOML.

    """
    try:
        text = path.read_text(encoding="utf-8")
        return tomllib.loads(text), text
    except FileNotFoundError:
        raise PlanError(f"there is no plan {path}.", "examples/ holds plans to start from.") from None
    except OSError as error:
        raise PlanError(f"{path} cannot be read ({error.strerror}).") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise PlanError(f"{path} is not TOML: {error}.") from error


def parse(tables: Mapping[str, Any]) -> PlanFile:
    """Check the grammar of a plan.

    Raises:
        PlanError: one sentence per finding.

    """
    try:
        return PlanFile.model_validate(dict(tables))
    except ValidationError as error:
        raise PlanError(f"{'; '.join(dict.fromkeys(_findings(error)))}.") from None


def suggest(name: str, known: Iterable[str]) -> str:
    """Return "Did you mean ...?" or the list of what is known."""
    listed = sorted(known)
    near = difflib.get_close_matches(name, listed, n=1)
    return f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(listed)}."


def _findings(error: ValidationError) -> Iterable[str]:
    for item in error.errors():
        place = [str(part) for part in item["loc"]]
        if place[:1] == ["axes"]:
            del place[2:3]  # the tag of the union's branch
        where = ".".join(place)
        if item["type"] == "extra_forbidden":
            inner: dict[str, type[BaseModel]] = {"sampling": Sampling, "axes": Range, "pattern": Pattern}
            table = inner.get(place[0], PlanFile) if len(place) > 1 else PlanFile
            yield f"unknown name {where!r}: {suggest(place[-1], _names(table)).rstrip('.')}"
        elif place[:1] == ["axes"] and item["type"] == "tuple_type":
            yield f"{where}: a list of numbers, or {{from = 0.01, to = 0.04, count = 4}} (got {item['input']!r})"
        elif place[:1] == ["axes"] and item["type"] == "float_type":
            listed = '[[samples]], with kind = "list" under [sampling]'
            yield f"axes.{place[1]}: an axis is of numbers; words and lists may stand in {listed}"
        elif place == ["solver"] and item["type"] == "missing":
            yield 'no solver is named: begin with a line such as solver = "dehydration"'
        else:
            yield f"{where + ': ' if where else ''}{item['msg'].removeprefix('Value error, ')}"


def _names(model: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in model.model_fields.items()]
