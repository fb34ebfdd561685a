"""Refinement as rounds: propose samples, run them, rebuild the table from its runs and these, measure, and again.

What earlier rounds asked for is in the ledger, under the plan's name with ":refined". The next call finishes it first
and counts it, so that the same command goes on where it was stopped, and does nothing once all is there.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver import registry
from store import scalars, tables
from store.blending import methods
from store.blending.methods.weights import Samples
from store.generations import trust
from store.generations.samples import Choice, read_axes
from store.ledger.jobs import Job, JobSpec
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces.measures import Surface, compare
from store.tables import TableInfo

from ..planning.plan import Plan
from ..running.report import Event
from ..running.runner import run_jobs
from . import refine, score
from .refine import Proposal, State

__all__ = ["Round", "held_out_error", "rounds"]

#: How proposals are made: `refine.propose`, or what it is to be compared with.
Propose = Callable[[Plan, State, Sequence[Mapping[str, float]]], Iterator[Proposal]]


class Round(NamedTuple):
    """After a round: runs added in all, the points of this round, how many of its runs failed, and the errors.

    `left_out` is the mean error of the samples, each predicted from the others; `held_out` that of the `held_runs` runs
    which the table has not seen and which lie inside it, if there are any. A table that grows takes more of them in.
    """

    added: int
    points: tuple[dict[str, float], ...]
    failed: int
    left_out: float
    held_out: float | None
    held_runs: int
    digest: str


def rounds(
    plan: Plan,
    store: Store,
    name: str,
    executor: Executor,
    count: int,
    measure: str,
    held: Path | None = None,
    observe: Callable[[Event], None] | None = None,
    stop: threading.Event | None = None,
    propose: Propose = refine.propose,
) -> Iterator[Round]:
    """Add runs to a table until `count` were added in all, by this call or earlier ones; yield after every round.

    The first round is what is there already. A grid grows by whole lines, and never beyond `count`.

    Raises:
        PlanError, MixedSamples: the plan and the table do not fit; nothing was run.
        InvalidOption: no run of `held` lies between the table's samples; nothing was run.
        UnknownJob: none of the table's own runs is stored; nothing was run.
        StoreError: the store is full or damaged; what is done is kept.

    """
    halt = stop or threading.Event()
    width = getattr(executor, "width", 1)
    refine.check(plan, tables.info(store, name))
    tables.check_grows(store, tables.info(store, name))
    if held is not None:
        _held(store, name, held)

    def run(jobs: Sequence[JobSpec]) -> int:
        return len(run_jobs(jobs, store, executor, refine.name_of(plan), observe, stop=halt).failed) if jobs else 0

    def measured(points: tuple[dict[str, float], ...], failed: int) -> Round:
        state = refine.read(store, name, measure)
        error, runs = (None, 0) if held is None else held_out_error(store, name, held, measure)
        added = len(_asked(store, plan).keys() & set(state.table.keys))
        return Round(added, points, failed, state.mean, error, runs, state.table.digest)

    failed = run([job for job in _asked(store, plan).values() if job.state in ("wanted", "running")])
    _add(store, name, _asked(store, plan))
    last = measured((), failed)
    yield last
    while last.added < count and not halt.is_set():
        state, asked = refine.read(store, name, measure), _asked(store, plan)
        avoid = [_point(state.table, job) for job in asked.values() if job.key not in state.table.keys]
        wanted = list(_fitting(propose(plan, state, avoid), min(count - last.added, width), count - last.added))
        points = tuple(itertools.chain.from_iterable(proposal.points for proposal in wanted))
        if not points:
            return
        samples = [sample for proposal in wanted for sample in proposal.samples]
        failed = run(refine.with_samples(plan, samples).jobs())
        if halt.is_set():
            return
        _add(store, name, _asked(store, plan))
        last = measured(points, failed)
        yield last


def _fitting(proposals: Iterator[Proposal], enough: int, most: int) -> Iterator[Proposal]:
    """Yield proposals until they hold `enough` runs; those that would make more than `most` are passed over."""
    held = 0
    for proposal in itertools.islice(proposals, 64):
        if held + len(proposal.points) <= most:
            held += len(proposal.points)
            yield proposal
        if held >= enough:
            return


def _asked(store: Store, plan: Plan) -> dict[str, Job]:
    """Return the jobs of all rounds so far."""
    return {job.key: job for job in store.ledger.jobs(plan=refine.name_of(plan))}


def _point(table: TableInfo, job: JobSpec) -> dict[str, float]:
    return read_axes(job.params, {axis: table.places[axis] for axis in table.axes})


def _add(store: Store, name: str, asked: Mapping[str, Job]) -> None:
    """Rebuild the table with the finished ones of `asked`; a grid stays one, or as it is."""
    table = tables.info(store, name)
    more = [job for job in asked.values() if job.state == "done" and job.key not in table.keys]
    if more and not _would_end_grid(store, table, more):
        solver = registry.get(table.solver)
        grown = tables.rebuild(store, solver, name, more=[job.key for job in more])
        if scalars.path_of(store, name).is_file():
            scalars.build(store, solver, name, Choice(keys=grown.keys))


def _would_end_grid(store: Store, table: TableInfo, more: Collection[Job]) -> bool:
    with tables.open(store, table.name) as opened:
        values = np.stack([opened[axis].values for axis in table.axes], axis=-1)
    added: Any = [list(_point(table, job).values()) for job in more]
    return Samples(values).is_grid and not Samples(np.vstack([values, added])).is_grid


def held_out_error(store: Store, name: str, held: Path, measure: str) -> tuple[float, int]:
    """Return the default method's mean error by a measure over held-out runs and stages; how many.

    Raises:
        InvalidOption: no run of `held` lies between the table's samples.

    """
    table, found = _held(store, name, held)
    errors = [
        trust.errors(compare(Surface(case.fresh, case.found(methods.DEFAULT, s)), Surface(case.fresh, case.truth(s))))[
            measure
        ]
        for case in found
        for s in table.stages
    ]
    return float(np.mean(errors)), len(found)


def _held(store: Store, name: str, held: Path) -> tuple[ShapeTable, list[score.Case]]:
    table = ShapeTable.open(store, name, verify=False, surfaces=registry.surface)
    return table, score.cases(store, table, held)[0]
