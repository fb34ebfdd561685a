"""A solver as a value, and what leaves it: named, finite, with units and provenance."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from .. import __version__, quantities
from ..arrays import Floats
from ..lattice import azimuths, colatitudes, window
from ..rounding import from_zero
from .clock import Clock
from .context import Context
from .errors import InvalidInput, Unstable
from .live import Live
from .looks import Looks, Shade
from .need import Need, Quality, Region
from .params import Params
from .surface import Extent, Fresh, Surface
from .words import named

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Cost", "Solver", "StageAxis", "finish"]

T = TypeVar("T")

#: Distance [r1] within which two fresh surfaces are of one fruit, but for their skins.
_ALIKE = 0.02
_QUALITIES: tuple[Quality, ...] = ("preview", "default", "fine")
#: Fields that are of a mesh, not of the lattice.
_MESHED = frozenset(("mesh_position", "triangle"))


class StageAxis(NamedTuple):
    """The axis along which a run advances: shrinkage for fruits, time for rot."""

    symbol: str
    long_name: str
    units: str
    lowest: float
    highest: float
    default: tuple[float, ...]

    @property
    def reach(self) -> tuple[float, float]:
        """From nothing to the last of the stages that are usual."""
        return 0.0, max(self.default, key=abs, default=0.0)


class Cost(NamedTuple):
    """What a run is expected to take."""

    seconds: float
    bytes: int


@dataclass(frozen=True)
class Solver:
    """One system of equations as a value: name, version, parameters, fields, run and cost.

    `version` changes whenever the numbers change, so that stored results of the old numbers are not reused. `tables_of`
    are versions before it that solved the same equations, on the same meshes and to the same residuals, by another way:
    their tables hold equilibria as this one finds them, and are answered from.
    `run` is called with a settled need only.

    The rest is what the floors above want to know of it: `surface`, where the fresh shape is parametric, so that
    tables of shapes can be built; `looks`, its colours and labels; `preset_stages`, the stages worth a look of those
    presets that the default ones do not suit; `onset(params, method=, kappa_ratio=, quality=, context=)`, where it
    can say at which stage its shape begins to lose its symmetry; `incidental`, parameters that say how a run is done
    and not what of: tables that differ in them hold the same shapes; `error(params, quality, last stage)`, the relative
    error to expect of these parameters, which refuses what was never measured; `relax(params, position, stage, need,
    context, steps)`, which brings a surface on the lattice into the equilibrium next to it, or so many steps nearer,
    and returns what `run` returns of one stage, how far it `moved` and from which residual (`residual_placed`).
    `tolerances` are the worst of each quality over all that was. `clock` turns hours under given conditions into
    stages. `live` begins a run that is acted upon while it goes. `sizes` are lengths of r1, or of the solver's own
    unit, in metres by preset, as such fruits are when fresh. `extent` says how large what is run is at the start.
    `remarks` says in words, before any work, what is worth knowing of a run, as its result's `note` does; it refuses
    what the run would refuse at once.
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
    surface: Surface | None = None
    looks: Looks = field(default_factory=Looks)
    preset_stages: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    onset: Callable[..., Any] | None = None
    incidental: tuple[str, ...] = ("seed",)
    error: Callable[[Any, Quality, float], float] | None = None
    relax: Callable[..., xr.Dataset] | None = None
    clock: Clock | None = None
    live: Live | None = None
    sizes: Mapping[str, float] = field(default_factory=dict)
    extent: Callable[[Any], Extent] | None = None
    remarks: Callable[[Any, Need], str] | None = None
    tables_of: tuple[str, ...] = ()

    def answers_from(self, version: str) -> bool:
        """Return whether a table of that version holds what this one would solve, but for the way to it."""
        return version == self.version or version in self.tables_of

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
        return self.params.parse(self.params.over(base, named(values)))

    def stages_after(
        self, hours: Iterable[float], under: Mapping[str, Any], preset: str | None = None
    ) -> tuple[float, ...]:
        """Return the stages after hours under conditions, those of a preset if one is named.

        Raises:
            InvalidInput: this solver knows no hours, or not under these conditions, or has no such preset.

        """
        if preset is not None and preset not in self.presets:
            self.parse({}, preset)  # says which there are
        if self.clock is None:
            raise InvalidInput(
                f"{self.name} does not turn hours into stages.",
                advice=f"Name stages: {self.stages.long_name} [{self.stages.units}].",
            )
        return self.clock.stages(hours, under, preset)

    def conditions_as(self, advice: str, write: Callable[[Mapping[str, str]], str]) -> str:
        """Return an advice about hours with its conditions, NAME=VALUE there, as whoever asked writes them."""
        return advice if self.clock is None else self.clock.written(advice, write)

    def metres(self, values: Mapping[str, Any]) -> float | None:
        """Return the length of r1 [m] of what has these parameters, plain values by name; None where nobody knows.

        Known are the sizes of presets: what has the fresh shape of one alone, but for its skin, is as large as that.
        Where several have one shape, all that a preset says must agree.
        """
        return self._of_alike(values, self.sizes.get) if self.sizes else None

    def shade(self, values: Mapping[str, Any]) -> Shade | None:
        """Return the shade of what has these parameters, plain values by name, as `metres` its size; None where the
        presets of that shape have none, or each its own.
        """
        shades = self.looks.shades

        def named(preset: str) -> str | None:
            found = self.looks.shade_of((preset,))
            return None if found is None else found[0]

        name = self._of_alike(values, named) if shades else None
        return None if name is None else shades[name]

    def _of_alike(self, values: Mapping[str, Any], of: Callable[[str], T | None]) -> T | None:
        """Return what `of` says of the presets with the fresh shape of these parameters; None unless they agree."""
        plain = self.params.model_validate({}).model_dump(mode="json")
        asked = self.fresh({**plain, **values})
        if asked is None:
            return None
        said, shapes = self._known_presets
        points = asked.points(*_angles())
        alike = [name for name, one in shapes.items() if _distance(points, one) < _ALIKE]
        if len({of(name) for name in alike}) > 1:
            full = {**plain, **values}
            alike = [n for n in alike if all(_same(said[n].get(f), full.get(f)) for f in self.presets[n])]
        found = {of(name) for name in alike}
        return found.pop() if len(found) == 1 else None

    @cached_property
    def _known_presets(self) -> tuple[Mapping[str, Mapping[str, Any]], Mapping[str, Floats]]:
        """The presets' parameters, and points of the fresh shapes of those that have one: made once."""
        said = {name: self.parse({}, name).model_dump(mode="json") for name in self.presets}
        shapes = {name: one.points(*_angles()) for name, full in said.items() if (one := self.fresh(full)) is not None}
        return said, shapes

    def axis_units(self) -> dict[str, str]:
        """Return the units of the scalar axes, from the parameters' schema."""
        extras = {field: info.json_schema_extra for field, info in self.params.model_fields.items()}
        return {
            axis: str(extra.get("units", "1"))
            for axis, (field, _) in self.params.axes.items()
            if isinstance(extra := extras[field], dict)
        }

    def fresh(self, params: Mapping[str, Any]) -> Fresh | None:
        """Return the fresh shape that parameters, plain values by name, belong to; None where nobody knows it.

        Raises:
            InvalidGeometry: no shape has these parameters.

        """
        if self.surface is None or any(name not in params for name in self.surface.fields):
            return None
        return self.surface.of(params)

    def settle(self, need: Need, preset: str | None = None, of: Iterable[Params] = ()) -> Need:
        """Fill in the defaults of `need`, those of a preset if one is named; refuse what this solver cannot give.

        of: the parameters that it is asked for, all of which a tolerance must hold for.

        Raises:
            InvalidInput: unknown field, stage off the axis, a region off the surface or between the points of the
                lattice, fields that none can be cut from, a tolerance beside a quality or finer than what was measured.

        """
        unknown = [f for f in need.fields if f not in self.fields]
        if unknown:
            near = difflib.get_close_matches(unknown[0], self.fields, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise InvalidInput(
                f"{self.name} has no field {unknown[0]!r}.", advice=f"{hint}Known: {', '.join(self.fields)}."
            )
        axis = self.stages
        stages = need.stages or self.preset_stages.get(preset or "", axis.default)
        for stage in stages:
            if not axis.lowest <= stage <= axis.highest:
                raise InvalidInput(
                    f"stage {stage:.15g} lies outside {axis.symbol} = {axis.lowest:g} to {axis.highest:g}.",
                    advice=f"Ask for stages ({axis.long_name}) in that range.",
                )
        if need.start is not None:
            self._check_start(need, stages)
        quality: Quality = need.quality
        if need.tolerance is not None:
            if "quality" in need.model_fields_set:
                raise InvalidInput("a tolerance picks the quality, and one is named.", advice="Leave one of them out.")
            quality = self._quality_for(need.tolerance, {min(stages), max(stages)}, tuple(of))
        resolution = need.resolution or self.default_resolution[quality]
        if need.region is not None:
            _check_region(need.region, resolution)
            self._check_cut(need.fields)
        return need.model_copy(
            update={
                "fields": tuple(sorted(need.fields or self.default_fields)),
                "stages": tuple(sorted(set(stages))),
                "quality": quality,
                "tolerance": None,
                "resolution": resolution,
            }
        )

    def _check_start(self, need: Need, stages: tuple[float, ...]) -> None:
        """Refuse to relax what cannot be."""
        if self.relax is None:
            raise InvalidInput(f"{self.name} relaxes no surfaces.", advice="Leave need.start out.")
        if len(stages) != 1:
            raise InvalidInput("one shape is relaxed at a time.", advice="Name one stage.")
        if need.tolerance is not None:
            raise InvalidInput("relaxing promises no tolerance.", advice="Leave it out, or run it without a start.")

    def _check_cut(self, fields: Iterable[str]) -> None:
        """Refuse fields that a region cuts nothing from, where others are that it does; who has none says so itself."""
        whole = [name for name in fields if name in _MESHED]
        if whole and "position" in self.fields:
            raise InvalidInput(
                f"{whole[0]} is of the whole mesh, of which a region cuts no part.",
                advice="Ask for 'position', which is on the lattice, or leave the region out.",
            )

    def _quality_for(self, tolerance: float, ends: Iterable[float], of: tuple[Params, ...]) -> Quality:
        """Return the cheapest quality whose error is at most `tolerance` at both ends of the stages, for all `of`."""
        best = math.inf
        for quality in _QUALITIES:
            if self.error is not None and of:
                reached = max(self.error(params, quality, end) for params in of for end in ends)
            else:
                reached = self.tolerances.get(quality, math.inf)
            if reached <= tolerance:
                return quality
            best = min(best, reached)
        raise InvalidInput(
            f"a relative error of {tolerance:g} is finer than what {self.name} was measured to reach.",
            advice=f"The finest setting was measured at {from_zero(best)}." if best < 1 else "Name a quality instead.",
        )

    def solve(self, params: Params, need: Need | None = None, context: Context | None = None) -> xr.Dataset:
        """Settle the need, run, and check what leaves: named, finite, with units.

        Raises:
            SolverError: typed, with the converged stages attached where there are any.

        """
        settled, observer = self.settle(need or Need(), of=(params,)), context or Context()
        if settled.start is None or self.relax is None:
            return finish(self.run(params, settled, observer), self, params, settled)
        stage = settled.stages[0]
        position = np.asarray(observer.start(settled.start, params, stage), np.float64)
        return finish(self.relax(params, position, stage, settled, observer), self, params, settled)

    def relaxed(
        self,
        params: Params,
        position: Floats,
        stage: float,
        need: Need | None = None,
        context: Context | None = None,
        steps: int | None = None,
    ) -> xr.Dataset:
        """Relax a surface (n, 2n, 3) at a stage, for about `steps` at most, and check what leaves as `solve` does.

        Raises:
            InvalidInput: this solver relaxes nothing, the need cannot be met, or the surface is not finite.
            SolverError: typed.

        """
        if self.relax is None:
            raise InvalidInput(f"{self.name} relaxes no surfaces.", advice="Run it: it finds its own.")
        if not np.isfinite(position).all():
            raise InvalidInput("the surface has points that are not finite.", advice="Give the position of a look-up.")
        if steps is not None and steps < 1:
            raise InvalidInput(f"steps = {steps} are none.", advice="Give one or more, or leave them out.")
        asked = (need or Need()).model_copy(update={"stages": (stage,)})
        settled = self.settle(asked, of=(params,))
        result = self.relax(params, position, stage, settled, context or Context(), steps)
        return finish(result, self, params, settled)


def _angles() -> tuple[Floats, Floats]:
    """Return colatitudes and azimuths at which fresh shapes are compared."""
    return np.meshgrid(np.linspace(0, np.pi, 9), np.linspace(0, 2 * np.pi, 8, endpoint=False), indexing="ij")


def _distance(points: Floats, others: Floats) -> float:
    """Return how far two fresh surfaces (..., 3) are apart at most, but for a skin that is thicker all over."""
    away = points / np.linalg.norm(points, axis=-1, keepdims=True)
    between = others - points
    thicker = (between * away).sum(axis=-1).mean()
    return float(np.abs(between - thicker * away).max())


def _same(one: Any, other: Any) -> bool:
    """Return whether two plain values are the same, numbers to what text keeps of them."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(_same(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-9)
    return bool(one == other)


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
        title=solver.title,
        # without the time: the same question gives the same bytes
        history=f"solved by {solver.name} {solver.version} of wizen {__version__}",
        Conventions="CF-1.11",
    )
    return result


def _check_region(region: Region, resolution: int) -> None:
    """Refuse a part of the surface that would be less than what is named, or nothing."""
    for name, (low, high), least, most, advice in (
        ("colatitude", region.colatitude, 0, 180, "Stay within 0 to 180."),
        ("azimuth", region.azimuth, -360, 720, "Take a turn at most, within -360 to 720."),
    ):
        if low < least or high > most or high - low > 360:
            raise InvalidInput(f"region.{name} runs from {low:g} to {high:g} degrees.", advice=advice)
    rows, columns = window(resolution, region)
    if not colatitudes(resolution)[rows].size or not azimuths(resolution)[columns].size:
        raise InvalidInput(
            f"no point of the lattice of {resolution} colatitudes lies in this region.",
            advice=f"Widen it, or raise the resolution: points are {180 / resolution:.3g} degrees apart.",
        )
