"""A plan: which samples of a solver's parameters are wanted, and what of each. Everything is checked before any work.

solver = "dehydration"
preset = "sphere"
[axes]
gamma = [10, 30, 50]
te = {from = 0.01, to = 0.04, count = 4}
[need]
stages = [0.1, 0.2]
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from solver import registry
from solver.contract import InvalidGeometry, InvalidInput, Need, Params, Solver
from store import starter
from store.ledger.jobs import JobSpec
from store.ledger.rows import QUEUE

from ..errors import PlanError
from . import planfile
from .planfile import PlanFile
from .points import points

__all__ = ["Plan", "job"]


@dataclass(frozen=True)
class Plan:
    """Validated samples and a settled need.

    `axes` are the names that vary; `skipped` counts the impossible combinations that were left out, `repeated` the
    samples that were listed more than once. `first` is the plan of the pattern that the samples start from, `controls`
    that of the samples that are run without it as well.

    Raises:
        PlanError: it is called as the jobs that are asked for one by one are in the ledger.

    """

    name: str
    solver: Solver
    samples: tuple[Params, ...]
    need: Need
    axes: tuple[str, ...]
    skipped: int = 0
    repeated: int = 0
    first: Plan | None = None
    controls: Plan | None = None

    def __post_init__(self) -> None:
        if self.name.partition(":")[0] == QUEUE:
            said = f"no plan may be called {self.name!r}: so are the jobs that are asked for over HTTP."
            raise PlanError(said, "Say another `name` in it, or rename its file.")

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read a plan file.

        Raises:
            PlanError: anything wrong in it, with the place and what to change.

        """
        return cls.read(path)[0]

    @classmethod
    def read(cls, path: Path | str) -> tuple[Self, str]:
        """Read a plan file; return the plan, and its text as it is written.

        Raises:
            PlanError: anything wrong in it, with the place and what to change.

        """
        path = Path(path)
        tables, text = planfile.load(path)
        return cls.parse(tables, name=path.stem), text

    @classmethod
    def parse(cls, tables: Mapping[str, Any], name: str = "plan") -> Self:
        """Validate a plan given as nested mappings; `name` is used if the plan does not name itself.

        Raises:
            PlanError: anything wrong in it, with the place and what to change.

        """
        written = planfile.parse(tables)
        try:
            solver = registry.get(written.solver)
            asked = Need.parse(_asked(written, solver))
            need = solver.settle(asked.model_copy(update={"tolerance": None}), written.preset)
        except InvalidInput as error:
            raise PlanError(error.message, error.advice) from None
        _check_names(written, solver)
        samples, skipped, repeated = _samples(written, solver)
        try:
            # a tolerance holds for every sample
            need = solver.settle(asked, written.preset, samples.values())
        except InvalidInput as error:
            raise PlanError(f"[need]: {error.message}", error.advice) from None
        name = written.name or name
        try:
            name.encode()
        except UnicodeEncodeError:  # of a file whose name is bytes of another encoding
            raise PlanError("the plan's name is not UTF-8.", "Rename its file, or say `name` in it.") from None
        first = controls = None
        if written.pattern is not None:
            first, controls, samples = _from_pattern(written, written.pattern, solver, need, name, samples)
        varied = written.axes or dict.fromkeys(itertools.chain.from_iterable(written.samples))
        return cls(
            name=name,
            solver=solver,
            samples=tuple(samples.values()),
            need=need,
            axes=tuple(varied),
            skipped=skipped,
            repeated=repeated,
            first=first,
            controls=controls,
        )

    def parts(self) -> tuple[Plan, ...]:
        """Return the plans to run, one after the other: what the samples start from, the samples, the controls."""
        return tuple(plan for plan in (self.first, self, self.controls) if plan is not None)

    def jobs(self) -> list[JobSpec]:
        """Return one job per sample, in the plan's order, with distinct keys."""
        return [job(self.solver, params, self.need) for params in self.samples]


def job(solver: Solver, params: Params, need: Need) -> JobSpec:
    """Return the job that computes `need` (settled) of `params`; its key is the same whoever asks."""
    return JobSpec.of(solver, params, need)


def _asked(written: PlanFile, solver: Solver) -> dict[str, Any]:
    """Return what is needed, with the stages that come after `hours` under the conditions of `under`."""
    need = dict(written.need)
    hours, under = need.pop("hours", None), need.pop("under", None)
    if hours is None:
        if under is not None:
            raise PlanError("[need]: under says how hours are spent, and there are none.", "Write hours = [24, 48].")
        return need
    if "stages" in need:
        raise PlanError("[need]: hours and stages exclude each other.", "Keep one of them.")
    if not isinstance(hours, list) or any(type(one) not in (int, float) for one in hours) or not hours:
        raise PlanError(f"[need]: hours are numbers, not {hours!r}.", "Write hours = [24, 48].")
    if under is not None and not isinstance(under, dict):
        raise PlanError(f"[need]: under is a table, not {under!r}.", "Write under = {temperature = 60}.")
    try:
        return {**need, "stages": solver.stages_after(hours, under or {}, written.preset)}
    except InvalidInput as error:
        raise PlanError(f"[need]: {error.message}", solver.conditions_as(error.advice, _under)) from None


def _under(conditions: Mapping[str, str]) -> str:
    """Return conditions as a plan is told them."""
    said = (f"{n} = {v if v.replace('.', '', 1).isdigit() else json.dumps(v)}" for n, v in conditions.items())
    return f"under = {{{', '.join(said)}}}"


def _samples(written: PlanFile, solver: Solver) -> tuple[dict[str, Params], int, int]:
    """Return the samples by what they say, how many were impossible and skipped, and how many said the same again."""
    samples: dict[str, Params] = {}
    skipped = repeated = tried = 0
    why: InvalidGeometry | None = None
    wanted = written.sampling.count if written.sampling.skip_invalid else None
    for values in points(written):
        tried += 1
        try:
            params = solver.parse({**written.set, **values}, written.preset)
        except InvalidGeometry as error:
            if not written.sampling.skip_invalid:
                advice = f"{error.advice} Change it, or set skip_invalid = true under [sampling]."
                raise PlanError(f"sample {_show(values)}: {error.message}", advice.strip()) from None
            skipped, why = skipped + 1, error
        except InvalidInput as error:
            where = f"sample {_show(values)}: " if values else ""
            raise PlanError(f"{where}{error.message}", error.advice) from None
        else:
            repeated += samples.setdefault(params.model_dump_json(), params) is not params
        if len(samples) == wanted:
            break
    if wanted is not None and 0 < len(samples) < wanted:
        raise PlanError(
            f"of {tried} points only {len(samples)} are possible, fewer than the {wanted} asked for.",
            "Change the ranges under [axes], or ask for fewer.",
        )
    if not samples:
        assert why is not None  # there is a point at least
        said = f"none of the {skipped} combinations is possible; of the last, {why.message}"
        raise PlanError(said, f"{why.advice} Or change the ranges under [axes].".lstrip())
    return samples, skipped, repeated


def _from_pattern(
    written: PlanFile, pattern: planfile.Pattern, solver: Solver, need: Need, name: str, samples: Mapping[str, Params]
) -> tuple[Plan, Plan | None, dict[str, Params]]:
    """Return the plan of the pattern, that of the controls, and the samples that start from the pattern."""
    axes = tuple(dict.fromkeys(itertools.chain.from_iterable([pattern.sample, *pattern.controls])))
    try:
        origin = solver.parse({**written.set, **pattern.sample}, written.preset)
        early = solver.settle(need.model_copy(update={"stages": (pattern.stage,), "fields": ()}))
        cold = tuple(solver.parse({**written.set, **values}, written.preset) for values in pattern.controls)
        begun = _begun_by(solver, origin, early)
        start = {"key": job(begun, origin, early).key, "stage": pattern.stage, "amplitude": pattern.amplitude}
        warm = {
            shown: solver.parse({**params.model_dump(mode="json"), "pattern": start})
            for shown, params in samples.items()
        }
    except InvalidInput as error:
        raise PlanError(f"[pattern]: {error.message}", error.advice) from None
    first = Plan(f"{name}-pattern", begun, (origin,), early, axes)
    controls = Plan(f"{name}-controls", solver, cold, need, axes) if cold else None
    return first, controls, warm


def _begun_by(solver: Solver, origin: Params, early: Need) -> Solver:
    """Return the solver as of the version whose run of the pattern comes with the package, else as it is.

    What only begins others need not be this version's, and what begins as before keeps its wrinkles.
    """
    versions = (solver.version, *solver.tables_of)
    known = (replace(solver, version=version) for version in versions)
    return next((older for older in known if starter.has(job(older, origin, early).key)), solver)


def _check_names(written: PlanFile, solver: Solver) -> None:
    """Refuse names that the solver does not have, and values given twice."""
    known = {*solver.params.model_fields, *solver.params.axes}
    places = {"set": written.set, "axes": written.axes}
    if written.pattern is not None:
        if "pattern" not in solver.params.model_fields:
            raise PlanError(f"[pattern]: runs of {solver.name} do not start from others.", "Leave it out.")
        places |= {"pattern.sample": written.pattern.sample}
        places |= {f"pattern.controls {i}": values for i, values in enumerate(written.pattern.controls, start=1)}
    places |= {f"samples {i}": sample for i, sample in enumerate(written.samples, start=1)}
    for place, values in places.items():
        for name in values:
            if name not in known:
                raise PlanError(f"[{place}]: {solver.name} has no parameter {name!r}.", planfile.suggest(name, known))
    # the scalar name of a whole field means the same value: te is exocarp_thickness
    fixed = {_target(solver, name): name for name in written.set}
    swept = {_target(solver, name) for name in written.axes}
    for target, name in fixed.items():
        if target in swept:
            raise PlanError(f"{name} stands under [set] and under [axes].", "Remove one of them.")
    if len(swept) < len(written.axes):
        raise PlanError("two names under [axes] mean the same parameter.", "Remove one of them.")


def _target(solver: Solver, name: str) -> tuple[str, int | None]:
    return solver.params.axes.get(name, (name, None))


def _show(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {_number(value)}" for name, value in values.items())


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
