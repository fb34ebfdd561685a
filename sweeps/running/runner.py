"""Claim, solve, store, note: runs a plan's jobs on any executor, from wherever an earlier run stopped.

The shards are the truth. Whatever is killed, a job's shard is either whole on the disk or not there; the next run
notes the first kind as done without solving, and solves the second. Several runners may work on one store.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, wait
from contextlib import AbstractContextManager, nullcontext

from store.ledger.jobs import JobSpec
from store.store import Store

from ..planning.plan import Plan
from .report import Event, Report
from .run import Run

__all__ = ["run_jobs", "run_parts", "run_plan", "run_queue"]

#: Seconds for which a claimed job belongs to its runner without a sign of life.
LEASE = 30.0
#: Seconds between two looks at whether to stop.
_LOOK = 0.1


def run_plan(
    plan: Plan,
    store: Store,
    executor: Executor,
    observe: Callable[[Event], None] | None = None,
    lease: float = LEASE,
    stop: threading.Event | None = None,
    again: bool = False,
) -> Report:
    """Run a plan with its pattern and its controls, and report of all of them together; see `run_jobs`."""
    reports = run_parts(plan, store, executor, lambda part: nullcontext(observe), lease, stop, again)
    return Report.of(plan.name, reports, sum(len(part.samples) for part in plan.parts()))


def run_parts(
    plan: Plan,
    store: Store,
    executor: Executor,
    watch: Callable[[Plan], AbstractContextManager[Callable[[Event], None] | None]],
    lease: float = LEASE,
    stop: threading.Event | None = None,
    again: bool = False,
) -> list[Report]:
    """Run the pattern that a plan's samples start from, the samples, and the controls; see `run_jobs`.

    `watch` gives each part its observer. Samples whose pattern could not be solved are not tried: the last report is
    the pattern's then. Nor is anything after a part that was stopped.
    """
    reports: list[Report] = []
    for part in plan.parts():
        with watch(part) as observe:
            reports.append(run_jobs(part.jobs(), store, executor, part.name, observe, lease, stop, again))
        if reports[-1].stopped or (part is plan.first and not reports[-1].complete):
            break
    return reports


def run_jobs(
    jobs: Iterable[JobSpec],
    store: Store,
    executor: Executor,
    name: str = "",
    observe: Callable[[Event], None] | None = None,
    lease: float = LEASE,
    stop: threading.Event | None = None,
    again: bool = False,
) -> Report:
    """Run jobs until each is done or given up, or until `stop` is set; return what was achieved.

    Args:
        jobs: what to compute, in this order.
        store: where results go.
        executor: any `concurrent.futures.Executor`; `sweeps.running.executors` makes good ones.
        name: name of the plan in the ledger.
        observe: is told of every start, progress and end, in the calling thread.
        lease: seconds after which others may take over a job whose worker gives no sign of life.
        stop: set it to end early: running solves are cancelled and wait for the next run.
        again: try once more what an earlier run gave up.

    Raises:
        StoreError: the disk is full or the ledger damaged. Running jobs wait for the next run.
        SweepError: the cluster went away.

    """
    stop, start = stop or threading.Event(), time.monotonic()
    run = Run(jobs, store, executor, name, observe, lease, stop, time.monotonic)
    _drive(run, run.rounds(again), stop)
    return run.report(time.monotonic() - start)


def run_queue(
    store: Store,
    executor: Executor,
    stop: threading.Event,
    patience: float = math.inf,
    observe: Callable[[Event], None] | None = None,
) -> int:
    """Run what is asked for in the store's queue, as it comes; return how many jobs were solved.

    Ends when `stop` is set (running solves then wait for the next run), or when nothing has come for `patience` [s].
    Jobs of a runner that died are taken over at once if it was a process of this host and namespace, else when their
    lease has run out.

    Raises:
        StoreError: the disk is full or the ledger damaged. Running jobs wait for the next run.
        SweepError: the cluster went away.

    """
    run = Run([], store, executor, "", observe, LEASE, stop, time.monotonic)
    _drive(run, run.drain(patience), stop)
    return run.solved


def _drive(run: Run, steps: Iterator[float], stop: threading.Event) -> None:
    """Let a runner take its steps in real time, whatever happens landing what it has started."""
    try:
        for patience in steps:
            _pause(run, patience, stop)
    finally:
        for patience in run.landing():
            wait(run.flying, min(patience, _LOOK), FIRST_COMPLETED)


def _pause(run: Run, patience: float, stop: threading.Event) -> None:
    """Wait until a result is there, the runner is to stop, or `patience` [s] is over."""
    until = time.monotonic() + patience
    while (left := until - time.monotonic()) > 0 and not stop.is_set():
        if not run.flying:
            stop.wait(left)
        elif wait(run.flying, min(left, _LOOK), FIRST_COMPLETED).done:
            return
