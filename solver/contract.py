"""What every solver is: one frozen value with validated parameters, a need, and a run that returns named data.

`Params` says what is simulated, `Need` says what of it is wanted (nothing else is computed), `Context` carries
progress, cancellation and randomness, and every failure is a `SolverError` that says what to change.
"""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from . import quantities

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Cancelled",
    "Context",
    "Cost",
    "InvalidGeometry",
    "InvalidInput",
    "Need",
    "NotConverged",
    "Params",
    "Quality",
    "Region",
    "Solver",
    "SolverError",
    "StageAxis",
    "Unstable",
    "finish",
]

Quality = Literal["preview", "default", "fine"]


# --- failures -------------------------------------------------------------------------------------------------


class SolverError(Exception):
    """Something a solver refuses or cannot finish. `advice` says what to change; `partial` holds what converged.

    `last_stage` is the last stage that converged (None if there is none) and `partial` the dataset of the stages
    up to it, complete and finite.
    """

    code: ClassVar[str] = "solver-error"

    def __init__(
        self,
        message: str,
        *,
        advice: str = "",
        partial: xr.Dataset | None = None,
        last_stage: float | None = None,
        residual: float | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.advice = advice
        self.partial = partial
        self.last_stage = last_stage
        self.residual = residual

    def __str__(self) -> str:
        return f"{self.message} {self.advice}".strip()

    def __reduce__(self) -> tuple[Any, ...]:
        # keyword-only arguments do not survive the default pickling, and errors travel between processes
        return _rebuild, (type(self), self.message, self.advice, self.partial, self.last_stage, self.residual)


def _rebuild(
    kind: type[SolverError],
    message: str,
    advice: str,
    partial: xr.Dataset | None,
    last_stage: float | None,
    residual: float | None,
) -> SolverError:
    return kind(message, advice=advice, partial=partial, last_stage=last_stage, residual=residual)


class InvalidInput(SolverError):
    """Parameters or a need that no run could honour; raised before any work."""

    code = "invalid-input"


class InvalidGeometry(InvalidInput):
    """Parameters that are valid one by one but describe an impossible shape."""

    code = "invalid-geometry"


class NotConverged(SolverError):
    """A stage that did not reach its residual."""

    code = "not-converged"


class Unstable(SolverError):
    """A run whose state left the finite or the admissible: inverted elements, exploding energy."""

    code = "unstable"


class Cancelled(SolverError):
    """The observer asked to stop."""

    code = "cancelled"


# --- parameters -----------------------------------------------------------------------------------------------


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80


def _named(values: object) -> Mapping[str, Any]:
    """Return `values` if they are names and values.

    Raises:
        InvalidInput: they are not.

    """
    if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
        raise InvalidInput(
            f"expected names and values, got {_SHORT.repr(values)}.", advice='Give an object such as {"te": 0.04}.'
        )
    return values


def _say(error: ValidationError, fields: Mapping[str, Any]) -> str:
    """Put pydantic's findings into one sentence per field, with the nearest name for a misspelt one."""
    parts, strange = [], False
    for item in error.errors():
        where = ".".join(str(p) for p in item["loc"])
        if item["type"] == "extra_forbidden":
            # a name within a group is none of the fields, so that none of them is what was meant
            near = difflib.get_close_matches(where, list(fields), n=1) if len(item["loc"]) == 1 else []
            strange |= not near and len(item["loc"]) == 1
            parts.append(f"unknown name {_SHORT.repr(where)}" + (f"; did you mean {near[0]!r}?" if near else ""))
        else:
            message = item["msg"].removeprefix("Value error, ")
            got = item.get("input")
            shown = f" (got {_SHORT.repr(got)})" if where and not isinstance(got, dict) else ""
            parts.append(f"{where + ': ' if where else ''}{message}{shown}")
    if strange:
        parts.append(f"known: {', '.join(sorted(fields))}")
    return "; ".join(parts)


class Params(BaseModel):
    """Base of every solver's parameters: frozen, finite, nothing unknown, every field with units and meaning.

    `axes` names the scalars that may be swept, set and queried: name -> (field, index or None).
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {}

    seed: int = Field(
        0,
        ge=0,
        lt=2**63,
        description="Seed of everything random in the run",
        json_schema_extra={"units": "1"},
    )

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Validate `values`: full field names, and scalar axis names that override single entries.

        Raises:
            InvalidInput: with one sentence per wrong value.
            InvalidGeometry: when the values contradict each other.

        """
        values = _named(values)
        plain = {k: v for k, v in values.items() if k not in cls.axes}
        known = {**cls.model_fields, **dict.fromkeys(cls.axes)}
        try:
            unknown = [k for k in plain if k not in known]
            if unknown:
                cls.model_validate({**plain})
            for name, (field, index) in cls.axes.items():
                if name not in values:
                    continue
                if index is None:
                    plain[field] = values[name]
                    continue
                whole = plain.get(field, cls.model_fields[field].default)
                items = list(whole) if isinstance(whole, list | tuple) else whole
                if isinstance(items, list) and index < len(items):
                    items[index] = values[name]
                    plain[field] = items
            return cls.model_validate(plain)
        except ValidationError as error:
            # findings without a place are those of the whole: valid numbers, impossible shape
            whole_only = all(not item["loc"] for item in error.errors())
            kind = InvalidGeometry if whole_only else InvalidInput
            raise kind(f"{_say(error, known)}.") from None

    def axis(self, name: str) -> float:
        """Return the scalar behind an axis name, e.g. `axis("te")`."""
        field, index = self.axes[name]
        value = getattr(self, field)
        return float(value if index is None else value[index])


# --- what is wanted -------------------------------------------------------------------------------------------


class Region(BaseModel):
    """A patch of the surface, in degrees; only samples inside it are returned."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    colatitude: tuple[float, float] = Field((0.0, 180.0), description="From the pole y > 0 [degree]")
    azimuth: tuple[float, float] = Field((0.0, 360.0), description="About the y axis, from x towards z [degree]")

    @field_validator("colatitude", "azimuth")
    @classmethod
    def _ordered(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not value[0] < value[1]:
            raise ValueError("a range runs from a smaller to a larger angle")
        return value


class Need(BaseModel):
    """What the asker wants to keep; a solver computes nothing else.

    An empty `fields` or `stages` stands for the solver's defaults; `Solver.settle` fills them in.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    fields: tuple[str, ...] = Field((), description="Names of the wanted variables")
    stages: tuple[float, ...] = Field((), description="Where on the stage axis to report; nothing beyond is solved")
    quality: Quality = Field("default", description="Mesh and step: preview, default or fine")
    tolerance: float | None = Field(
        None, gt=0, lt=1, description="Relative error asked for; picks the quality from the measured table"
    )
    resolution: int | None = Field(
        None, ge=4, le=1024, description="Colatitude samples of surface fields (azimuth has twice as many)"
    )
    region: Region | None = Field(None, description="Part of the surface to return; None is all of it")
    dtype: Literal["float32", "float64"] = Field("float32", description="Precision of the returned fields")

    @field_validator("stages")
    @classmethod
    def _sorted(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(sorted(set(value)))

    @field_validator("fields")
    @classmethod
    def _distinct(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(sorted(set(value)))

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Validate `values`.

        Raises:
            InvalidInput: with one sentence per wrong value.

        """
        try:
            return cls.model_validate(dict(_named(values)))
        except ValidationError as error:
            raise InvalidInput(f"{_say(error, cls.model_fields)}.") from None


# --- the run's surroundings -----------------------------------------------------------------------------------


class Context:
    """Progress, cancellation and randomness of one run. Bars, logs and event streams are observers of it."""

    def __init__(
        self,
        observe: Callable[[float, str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
        library: Callable[[str], xr.Dataset | None] | None = None,
        dried: Callable[[Mapping[str, float], float, int], np.ndarray] | None = None,
    ) -> None:
        self._observe = observe
        self._cancelled = cancelled
        self._library = library
        self._dried = dried
        self._fraction = 0.0

    def report(self, fraction: float, message: str = "") -> None:
        """Tell the observer how far the run is, 0 to 1; never goes backwards."""
        self._fraction = max(self._fraction, min(1.0, float(fraction)))
        if self._observe is not None:
            self._observe(self._fraction, message)

    def check_cancelled(self) -> None:
        """Raise `Cancelled` if the observer asked to stop. Solvers call this at least twice a second.

        Raises:
            Cancelled: always with no partial result; the solver attaches what it has.

        """
        if self._cancelled is not None and self._cancelled():
            raise Cancelled("the run was cancelled.")

    def dried(self, fruit: Mapping[str, float], shrinkage: float, resolution: int) -> np.ndarray:
        """Return the displacement (n, 2 n, 3) [r1] of a dried fruit, for runs that want its shape and no more.

        fruit: by the names of the dehydration solver's axes. shrinkage: its s, the share of each length that is lost.

        Raises:
            InvalidInput: nobody here knows dried shapes, or none of this fruit.

        """
        if self._dried is None:
            raise InvalidInput(
                "the shape comes from a table of dried fruits, and there is none here.",
                advice="Run it by `wizen solve`, by a sweep or as a job, or give Context(dried=sweeps.dried.dried).",
            )
        return self._dried(fruit, shrinkage, resolution)

    def result(self, key: str) -> xr.Dataset:
        """Return an earlier result by its key, for runs that start from one.

        Raises:
            InvalidInput: there is none, or this run is not tied to a store.

        """
        if self._library is None:
            raise InvalidInput(
                f"the run starts from the stored result {_SHORT.repr(key)}, and there is no store here.",
                advice="Run it by a sweep or as a job, beside that result.",
            )
        found = self._library(key)
        if found is None:
            raise InvalidInput(
                f"the run starts from the stored result {_SHORT.repr(key)}, which is not in the store.",
                advice="Run that one first.",
            )
        return found

    @staticmethod
    def generator(seed: int) -> np.random.Generator:
        """Return the only source of randomness a solver may use."""
        return np.random.default_rng(seed)


# --- the solver -----------------------------------------------------------------------------------------------


class StageAxis(NamedTuple):
    """The axis along which a run advances: shrinkage for fruits, time for rot."""

    symbol: str
    long_name: str
    units: str
    lowest: float
    highest: float
    default: tuple[float, ...]


class Cost(NamedTuple):
    """What a run is expected to take."""

    seconds: float
    bytes: int


@dataclass(frozen=True)
class Solver:
    """One system of equations as a value: name, version, parameters, fields, run and cost.

    `version` changes whenever the numbers change, so that stored results of the old numbers are not reused.
    `run` is called with a settled need only.
    """

    name: str
    version: str
    title: str
    params: type[Params]
    fields: tuple[str, ...]
    default_fields: tuple[str, ...]
    stages: StageAxis
    default_resolution: Mapping[str, int]
    tolerances: Mapping[str, float]
    presets: Mapping[str, Mapping[str, Any]]
    run: Callable[[Any, Need, Context], xr.Dataset]
    cost: Callable[[Any, Need], Cost]

    def parse(self, values: Mapping[str, Any], preset: str | None = None) -> Params:
        """Return validated parameters from a preset overlaid with `values`.

        Raises:
            InvalidInput: unknown preset, unknown name, value out of range, impossible shape.

        """
        base: Mapping[str, Any] = {}
        if preset is not None:
            if preset not in self.presets:
                near = difflib.get_close_matches(preset, list(self.presets), n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                raise InvalidInput(
                    f"{self.name} has no preset {preset!r}.",
                    advice=f"{hint}Known: {', '.join(sorted(self.presets))}.",
                )
            base = self.presets[preset]
        # a whole field given by hand replaces the preset's; a scalar axis replaces one entry of it
        return self.params.parse({**base, **_named(values)})

    def settle(self, need: Need) -> Need:
        """Fill in the defaults of `need` and refuse what this solver cannot give, before any work.

        Raises:
            InvalidInput: unknown field, stage off the axis, a tolerance finer than the measured table.

        """
        unknown = [f for f in need.fields if f not in self.fields]
        if unknown:
            near = difflib.get_close_matches(unknown[0], self.fields, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise InvalidInput(
                f"{self.name} has no field {unknown[0]!r}.", advice=f"{hint}Known: {', '.join(self.fields)}."
            )
        axis = self.stages
        stages = need.stages or axis.default
        for stage in stages:
            if not axis.lowest <= stage <= axis.highest:
                raise InvalidInput(
                    f"stage {stage:g} lies outside {axis.symbol} = {axis.lowest:g} to {axis.highest:g}.",
                    advice=f"Ask for stages ({axis.long_name}) in that range.",
                )
        quality: Quality = need.quality
        if need.tolerance is not None:
            fit = [
                q
                for q in ("preview", "default", "fine")
                if q in self.tolerances and self.tolerances[q] <= need.tolerance
            ]
            if not fit:
                best = min(self.tolerances.values())
                raise InvalidInput(
                    f"a relative error of {need.tolerance:g} is finer than what {self.name} was measured to reach.",
                    advice=f"The finest setting was measured at {best:g}.",
                )
            quality = fit[0]  # type: ignore[assignment]
        return need.model_copy(
            update={
                "fields": tuple(sorted(need.fields or self.default_fields)),
                "stages": tuple(sorted(set(stages))),
                "quality": quality,
                "tolerance": None,
                "resolution": need.resolution or self.default_resolution[quality],
            }
        )

    def solve(self, params: Params, need: Need | None = None, context: Context | None = None) -> xr.Dataset:
        """Settle the need, run, and check what leaves: named, finite, with units.

        Raises:
            SolverError: typed, with the converged stages attached where there are any.

        """
        settled = self.settle(need or Need())
        result = self.run(params, settled, context or Context())
        return finish(result, self, params, settled)


def finish(result: xr.Dataset, solver: Solver, params: Params, need: Need) -> xr.Dataset:
    """Attach units and provenance to a result, and refuse one that is not finite.

    Raises:
        Unstable: a NaN or an infinity in any variable.

    """
    for name in result.variables:
        values = result[name].values
        if np.issubdtype(values.dtype, np.floating) and not np.isfinite(values).all():
            raise Unstable(f"{solver.name} produced a value that is not finite in {name}.")
        result[name].attrs.update(quantities.attrs(str(name)))
    result["stage"].attrs.update(units=solver.stages.units, long_name=solver.stages.long_name)
    result.attrs.update(
        solver=solver.name,
        solver_version=solver.version,
        params=params.model_dump_json(),
        need=need.model_dump_json(),
        Conventions="CF-1.11",
    )
    return result
