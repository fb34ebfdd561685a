"""Which stored run an item means, by its key or by what it is asked for, and what becomes of one that is not there."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from solver.contract import Need, Params, Quality, Solver, SolverError
from store.errors import StoreError, UnknownJob
from store.keys import is_key
from store.ledger.jobs import Job, JobSpec
from store.store import Store
from sweeps.errors import InvalidOption

from ... import vocabulary
from ...errors import InvalidQuery, ServiceError, Wrong
from ..request import Item

__all__ = ["Ask", "Asked", "Missing", "Runs", "Together", "find"]

_ORDER: tuple[Quality, ...] = ("preview", "default", "fine")


class Asked(NamedTuple):
    """A run that would answer an item: what `POST /v1/jobs` is told of it, and the job that it is."""

    solver: Solver
    preset: str | None
    parameters: dict[str, Any]
    params: Params
    need: Need
    spec: JobSpec


#: Asks for a run; returns the job, or None and what the asker may do.
Ask = Callable[[Asked], tuple[Job | None, str]]


@dataclass(frozen=True)
class Missing:
    """A run that is not stored: what is to be computed, whether somebody does, else why not and what to do."""

    solver: Solver
    params: Params
    spec: JobSpec
    job: Job | None
    why: str
    advice: str

    def to_json(self) -> dict[str, Any]:
        """Return what the report says of it."""
        job = self.job
        state = None if job is None else {"id": job.key, "state": job.state, "progress": job.progress}
        return {"key": self.spec.key, "job": state, "why": self.why, "advice": self.advice}


@dataclass(frozen=True)
class Runs:
    """Where runs are looked for, and how those are asked for that are not there."""

    store: Callable[[], Store]
    ask: Ask


class Together:
    """All stages at which a scene shows the same run: one job has them all, and a job a stage would each begin anew."""

    def __init__(self, items: Sequence[Item]) -> None:
        self._items = items

    @cached_property
    def _stages(self) -> dict[str, tuple[float, ...]]:
        found: dict[str, set[float]] = {}
        for item in self._items:
            if item.run is None:
                found.setdefault(_run(item), set()).update((*item.stages, *item.variants))
        return {name: tuple(sorted(stages)) for name, stages in found.items()}

    def stages(self, item: Item) -> tuple[float, ...]:
        """Return the stages of an item of the scene, and of all others that are of its run."""
        return self._stages[_run(item)]


def _run(item: Item) -> str:
    return json.dumps([item.solver, item.preset, item.parameters, item.quality], sort_keys=True)


def find(item: Item, runs: Runs, stages: Sequence[float] = ()) -> str | Missing:
    """Return the key of the stored run that an item means, or what is missing: a run of these stages, where given.

    Raises:
        InvalidQuery: there is no such run, nobody can compute it, or it failed.
        SolverError, ServiceError, StoreError: as the solver or the store say it.

    """
    return _asked(item, runs, stages or item.stages) if item.run is None else _named(item.run, runs)


def _named(run: str, runs: Runs) -> str | Missing:
    from sweeps import results

    store, key = runs.store(), run.lower()
    if not is_key(key):
        try:
            return results.resolve(store, key)
        except InvalidOption as error:
            raise InvalidQuery.of([Wrong("run", error.message.rstrip("."), error.advice)]) from None
    if store.has(key):
        return key
    job = _job(store, key)
    if job is None or job.state == "done":
        advice = "`wizen results` and GET /v1/results list what is."
        raise InvalidQuery.of([Wrong("run", f"nothing is stored under {key[:12]}, and nobody asked for it", advice)])
    _check_failed(job, "run")
    solver = vocabulary.solver_named(job.solver)
    return Missing(solver, solver.parse(job.params), job, job, *_waiting(job))


def _asked(item: Item, runs: Runs, stages: Sequence[float]) -> str | Missing:
    asked = _question(item, item.stages)
    store = runs.store()
    if store.has(asked.spec.key):
        return asked.spec.key
    for job in _alike(store, asked.spec):
        if store.has(job.key) and _fits(job, asked.need, item.quality):
            return job.key
    with suppress(SolverError):  # a stage of another item's that there cannot be: that one is told
        asked = _question(item, stages)
    spec = asked.spec
    known = _job(store, spec.key)
    if known is not None:
        _check_failed(known, "preset" if item.preset else "parameters")
    try:
        found, advice = runs.ask(asked)
    except (ServiceError, StoreError, SolverError) as error:
        why = f"it is not stored, and was refused as a job: {error.message}"
        return Missing(asked.solver, asked.params, spec, None, why, error.advice)
    if found is None and (known is None or known.state not in ("wanted", "running")):
        return Missing(asked.solver, asked.params, spec, None, "it is not stored.", advice)
    waiting = found or known
    assert waiting is not None
    return Missing(asked.solver, asked.params, spec, waiting, *_waiting(waiting))


def _question(item: Item, stages: Sequence[float]) -> Asked:
    """Return what an item asks a solver: its surface at these stages, and what gives that its colours."""
    solver = vocabulary.solver_named(item.solver or "")
    params = solver.parse(item.parameters, item.preset)
    fresh = solver.fresh(params.model_dump(mode="json"))
    shape = "position" if fresh is not None and "position" in solver.fields else "mesh_position"
    more = (name for name in (*solver.looks.layers, *solver.looks.scalars) if name in solver.fields)
    need = Need(stages=tuple(stages), fields=(shape, *more), quality=item.quality or "default")
    settled = solver.settle(need, item.preset, (params,))
    return Asked(solver, item.preset, item.parameters, params, settled, JobSpec.of(solver, params, settled))


def _alike(store: Store, spec: JobSpec) -> Sequence[Job]:
    """Return the done jobs of the same parameters, the best first."""
    if not store.ledger.path.is_file():
        return ()
    done = [job for job in store.ledger.alike(spec) if job.state == "done"]
    wanted = set(spec.need["fields"])

    def rank(job: Job) -> tuple[int, int, int]:
        need = job.need
        return len(wanted & set(need["fields"])), _ORDER.index(need["quality"]), need["resolution"]

    return sorted(done, key=rank, reverse=True)


def _fits(job: Job, need: Need, quality: Quality | None) -> bool:
    """Return whether a job's result holds the whole surface at the wanted stages."""
    held = job.need
    surface = {"position", "displacement", "mesh_position"} & set(held["fields"])
    whole = bool(surface) and held.get("region") is None and held.get("start") is None
    near = all(any(abs(a - b) <= 1e-9 * max(1.0, abs(a)) for b in held["stages"]) for a in need.stages)
    return whole and near and quality in (None, held["quality"])


def _job(store: Store, key: str) -> Job | None:
    try:
        return store.ledger.get(key) if store.ledger.path.is_file() else None
    except UnknownJob:
        return None


def _check_failed(job: Job, name: str) -> None:
    if job.state != "failed":
        return
    error = job.error or {}
    detail = f"its run {job.key[:12]} failed: {error.get('message', 'nobody knows why.')}".rstrip(".")
    advice = f"{error.get('advice', '')} POST /v1/jobs tries it once more with again.".strip()
    raise InvalidQuery.of([Wrong(name, detail, advice)])


def _waiting(job: Job) -> tuple[str, str]:
    if job.state == "cancelled":
        return "its job was cancelled.", "Ask for it again with POST /v1/jobs."
    return f"its job is {job.state} ({job.progress:.0%}).", "Ask for the scene again when the job is done."
