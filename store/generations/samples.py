"""Which results make a table: those of one solver that differ in their scalar axes and in nothing else."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array
from solver.contract import Fresh, Surface

from ..canonical import canonical
from ..errors import EmptyTable, MixedSamples, UnknownJob
from ..families import ties
from ..ledger.jobs import Job
from ..store import Store

__all__ = [
    "Axes",
    "Choice",
    "Samples",
    "agree",
    "collect",
    "finished",
    "fullest",
    "insert",
    "is_surface",
    "read_axes",
    "rest_of",
]

#: Scalar axis name -> (field of the parameters, index in it or None), as in `Params.axes`.
Axes = Mapping[str, tuple[str, int | None]]

#: Parts of a need that do not change the numbers of the displacement.
_HARMLESS = ("fields", "dtype", "tolerance")


class Samples(NamedTuple):
    """Results that agree in all but their axes, sorted by key; `tied` are parameters that follow one of the axes."""

    keys: tuple[str, ...]
    values: tuple[dict[str, float], ...]
    axes: dict[str, tuple[str, int | None]]
    fixed: dict[str, Any]
    template: dict[str, Any]
    need: dict[str, Any]
    version: str
    tied: dict[str, ties.Tie]

    @property
    def varying(self) -> list[str]:
        """Names of the axes that take more than one value, and follow no other."""
        return [name for name in self.axes if name not in self.fixed and name not in self.tied]

    def points(self) -> Array | None:
        """Return the samples' places (sample, axes) on the varying axes; None for a single one."""
        names = self.varying
        return np.array([[values[name] for name in names] for values in self.values]) if names else None

    def fresh(self, surface: Surface | None) -> list[Fresh] | None:
        """Return the fresh shape of each sample; None where it does not follow from the parameters."""
        if surface is None or any(name not in self.template for name in surface.fields):
            return None
        return [surface.of(insert(self.template, self.axes, values)) for values in self.values]


class Choice(NamedTuple):
    """Which finished runs are wanted: None takes any plan, quality, version; `keys` names them, and then all must be
    there.
    """

    plan: str | None = None
    quality: str | None = None
    version: str | None = None
    keys: Collection[str] | None = None


def collect(store: Store, solver: str, axes: Axes, choice: Choice) -> Samples:
    """Find the results to tabulate: done, whole surfaces with a displacement.

    Raises:
        EmptyTable: there is none.
        MixedSamples: they differ in more than the axes.
        UnknownJob: one of the keys is not there.

    """
    jobs = finished(store, solver, choice, is_surface)
    if not jobs:
        raise EmptyTable(
            f"there are no results of {solver} to build a table from.",
            "A table needs finished runs over the whole surface with the field 'displacement'"
            + ("." if choice[:3] == (None,) * 3 else ", in the plan, quality and version asked for."),
        )
    agree(jobs)
    flat = [read_axes(job.params, axes) for job in jobs]
    rests = [rest_of(job.params, axes) for job in jobs]
    for name in {name for rest in rests for name in rest}:
        found = {canonical(rest.get(name)) for rest in rests}
        _refuse_mixed(name, found, f"{name} is not an axis: build one table per value, from plans of their own.")
    chosen = fullest(jobs, flat)
    first = chosen[0][0]
    common = set.intersection(*(set(job.need["fields"]) for job, _ in chosen))
    constant = {name: v for name, v in chosen[0][1].items() if all(values[name] == v for _, values in chosen)}
    return Samples(
        keys=tuple(job.key for job, _ in chosen),
        values=tuple(values for _, values in chosen),
        axes=dict(axes),
        fixed={**constant, **rests[0]},
        template=insert(first.params, axes, {name: min(v[name] for _, v in chosen) for name in axes}),
        need={**first.need, "fields": sorted(common)},
        version=first.version,
        tied=ties.find({name: [v[name] for _, v in chosen] for name in axes if name not in constant}),
    )


def is_surface(job: Job) -> bool:
    """Return whether a job's result is a whole surface with a displacement."""
    return "displacement" in job.need["fields"] and job.need.get("region") is None


def finished(store: Store, solver: str, choice: Choice, fits: Callable[[Job], bool] = lambda job: True) -> list[Job]:
    """Return the finished jobs of a solver that are wanted and fit; runs that others of them start from are not.

    Raises:
        UnknownJob: one of the keys is not there.

    """
    plan, quality, version, keys = choice
    store.learn()  # a table of some of what is here would not say so
    jobs = _named(store, solver, keys) if keys is not None else _done(store, solver, plan)
    # relaxed blends of a table are no samples of one
    jobs = [job for job in jobs if job.need.get("start") is None]
    jobs = [j for j in jobs if fits(j) and quality in (None, j.need["quality"]) and version in (None, j.version)]
    if plan is None:
        # a run that others start from is no sample of theirs
        origins = {pattern["key"] for job in jobs if (pattern := job.params.get("pattern"))}
        jobs = [job for job in jobs if job.key not in origins]
    return jobs


def agree(jobs: Sequence[Job]) -> None:
    """Refuse jobs that differ in their version, or in what they need beside fields.

    Raises:
        MixedSamples: they do.

    """
    _refuse_mixed("version", {job.version for job in jobs}, "Choose one with --version, or run the sweep again.")
    needs = [{name: value for name, value in job.need.items() if name not in _HARMLESS} for job in jobs]
    for name in needs[0]:
        hint = "Choose one with --quality" if name == "quality" else "Build from one plan with --plan"
        _refuse_mixed(name, {canonical(need.get(name)) for need in needs}, f"{hint}, or run the odd ones again.")


def fullest(jobs: Sequence[Job], places: Sequence[dict[str, Any]]) -> list[tuple[Job, dict[str, Any]]]:
    """Return one job per place, by key: the same run may be stored for several sets of fields, the fullest will do."""
    found: dict[bytes, tuple[Job, dict[str, Any]]] = {}
    pairs = zip(jobs, places, strict=True)
    for job, place in sorted(pairs, key=lambda pair: (-len(pair[0].need["fields"]), pair[0].key)):
        found.setdefault(canonical(place), (job, place))
    return sorted(found.values(), key=lambda pair: pair[0].key)


def _done(store: Store, solver: str, plan: str | None) -> list[Job]:
    return [job for job in store.ledger.jobs("done", plan) if job.solver == solver]


def _named(store: Store, solver: str, keys: Collection[str]) -> list[Job]:
    missing = set(keys) - {job.key for job in _done(store, solver, None)}
    if missing:
        raise UnknownJob(
            f"{len(missing)} of the table's {len(keys)} results are gone, {min(missing)} first.",
            "Run the sweep again, or build the table from what is left.",
        )
    return [job for job in _done(store, solver, None) if job.key in keys]


def _refuse_mixed(name: str, found: set[Any], advice: str) -> None:
    if len(found) > 1:
        shown = ", ".join(sorted(v.decode() if isinstance(v, bytes) else str(v) for v in found)[:4])
        raise MixedSamples(f"the results differ in {name}: {shown}.", advice)


def read_axes(params: Mapping[str, Any], axes: Axes) -> dict[str, float]:
    """Return the scalars behind the axes."""
    return {name: float(params[f] if i is None else params[f][i]) for name, (f, i) in axes.items()}


def insert(params: Mapping[str, Any], axes: Axes, values: Mapping[str, float]) -> dict[str, Any]:
    """Return `params` with the scalars of the axes replaced by `values`."""
    filled = {
        name: list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
        for name, value in params.items()
    }
    for name, value in values.items():
        field, index = axes[name]
        if index is None:
            filled[field] = value
        else:
            filled[field][index] = value
    return filled


def rest_of(params: Mapping[str, Any], axes: Axes) -> dict[str, Any]:
    """Return what no axis reaches: whole fields by name, entries of half-swept ones as field[index]."""
    swept = set(axes.values())
    rest: dict[str, Any] = {}
    for name, value in params.items():
        if (name, None) in swept:
            continue
        if any(field == name for field, _ in swept):
            rest |= {f"{name}[{i}]": entry for i, entry in enumerate(value) if (name, i) not in swept}
        else:
            rest[name] = value
    return rest
