"""Claim, solve, store, note: runs a plan's jobs on any executor, from wherever an earlier run stopped.

The shards are the truth. Whatever is killed, a job's shard is either whole on the disk or not there; the next run
notes the first kind as done without solving, and solves the second. Several runners may work on one store.
"""

from __future__ import annotations

import math
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from typing import Any

from store.ledger import Job, JobSpec
from store.queue import Queue
from store.store import Store

from .errors import SweepError
from .plan import Plan
from .report import Event, Failure, Kind, Report
from .work import Outcome, Task, beat, stop_mark, work

__all__ = ["run_jobs", "run_plan", "run_queue"]

#: How often a job is tried; what cannot succeed (invalid input) is tried once.
ATTEMPTS = 2
#: Seconds for which a claimed job belongs to its runner without a sign of life.
LEASE = 30.0
#: Seconds that stopping workers get to notice, before the runner leaves them alone.
_GRACE = 15.0

_LOST = {
    "code": "worker-lost",
    "message": "the worker process died while computing this.",
    "advice": "Often the memory did not suffice: use fewer workers or a coarser quality.",
}


def run_plan(
    plan: Plan,
    store: Store,
    executor: Executor,
    observe: Callable[[Event], None] | None = None,
    lease: float = LEASE,
    stop: threading.Event | None = None,
    again: bool = False,
) -> Report:
    """Run a plan; see `run_jobs`."""
    return run_jobs(plan.jobs(), store, executor, plan.name, observe, lease, stop, again)


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
        executor: any `concurrent.futures.Executor`; `sweeps.executors` makes good ones.
        name: name of the plan in the ledger.
        observe: is told of every start, progress and end, in the calling thread.
        lease: seconds after which others may take over a job whose worker gives no sign of life.
        stop: set it to end early: running solves are cancelled and wait for the next run.
        again: try once more what an earlier run gave up.

    Raises:
        StoreError: the disk is full or the ledger damaged. Running jobs wait for the next run.
        SweepError: the cluster went away.

    """
    return _Run(list(jobs), store, executor, name, observe, lease, stop or threading.Event()).run(again)


def run_queue(
    store: Store,
    executor: Executor,
    stop: threading.Event,
    patience: float = math.inf,
    observe: Callable[[Event], None] | None = None,
    lease: float = LEASE,
) -> int:
    """Run what is asked for in the store's queue, as it comes; return how many jobs were solved.

    Ends when `stop` is set (running solves then wait for the next run), or when nothing has come for `patience` [s].
    Jobs of a runner that died are taken over at once if it was on this host, else when their lease has run out.

    Raises:
        StoreError: the disk is full or the ledger damaged. Running jobs wait for the next run.
        SweepError: the cluster went away.

    """
    return _Run([], store, executor, "", observe, lease, stop).drain(patience)


class _Run:
    def __init__(
        self,
        jobs: list[JobSpec],
        store: Store,
        executor: Executor,
        name: str,
        observe: Callable[[Event], None] | None,
        lease: float,
        stop: threading.Event,
    ) -> None:
        self._jobs: Mapping[str, JobSpec] = {job.key: job for job in jobs}
        self._store, self._ledger = store, store.ledger
        self._executor, self._name, self._observe = executor, name, observe
        self._lease, self._stop = lease, stop
        self._id = f"{socket.gethostname()}:{os.getpid()}:{secrets.token_hex(4)}"
        self._shares_ledger: bool = getattr(executor, "shares_ledger", True)
        self._flying: dict[Future[Outcome], Job] = {}
        self._suspects: set[str] = set()
        self._finished: set[str] = set()
        self._solved = 0

    def run(self, again: bool) -> Report:
        start = time.monotonic()
        self._prepare(again)
        try:
            while not self._stop.is_set():
                self._launch()
                if not self._flying and not self._elsewhere():
                    break
                self._collect(beat(self._lease))
                self._attend()
        finally:
            self._land()
        return self._report(time.monotonic() - start)

    def drain(self, patience: float) -> int:
        queue = Queue(self._ledger)
        busy = time.monotonic()
        try:
            while not self._stop.is_set():
                waiting = queue.waiting()
                self._jobs = {job.key: job for job in waiting}
                self._free(waiting)
                self._launch()
                if self._flying:
                    busy = time.monotonic()
                elif time.monotonic() - busy >= patience:
                    break
                self._collect(beat(self._lease))
                self._attend()
        finally:
            self._land()
        return self._solved

    def _free(self, jobs: Iterable[Job]) -> None:
        """Take back jobs of runners that are known to be dead."""
        for job in jobs:
            if job.state == "running" and _is_dead(job.worker):
                self._ledger.release(job.key)

    def _prepare(self, again: bool) -> None:
        """Enter the jobs, take back those of dead runners, and make the ledger agree with the shards."""
        self._ledger.want(self._jobs.values(), self._name, again=again)
        before = self._states()
        if any(job.state == "done" and not self._store.has(job.key) for job in before.values()):
            self._ledger.rebuild(self._store.results())  # shards were deleted by hand
            before = self._states()
        self._free(before.values())
        self._finished = {key for key, job in before.items() if job.state in ("done", "failed")}

    def _launch(self) -> None:
        # a process that dies takes its neighbours down with it: suspects run alone, so that the culprit is known
        width = 1 if self._suspects else getattr(self._executor, "width", 1)
        while len(self._flying) < width:
            job = self._ledger.claim(self._id, self._lease, self._suspects or self._jobs.keys())
            if job is None and self._suspects:
                self._suspects.clear()
                return
            if job is None:
                return
            task = Task(self._store.root.absolute(), _spec(job), self._id, self._lease, self._shares_ledger)
            try:
                self._flying[self._executor.submit(work, task)] = job
            except BrokenExecutor:
                self._ledger.release(job.key)
                self._restart()
                return
            self._tell("started", job)

    def _collect(self, timeout: float) -> None:
        """Wait a moment for results and take them in."""
        if not self._flying:
            self._stop.wait(timeout)
            return
        ended, _ = wait(self._flying, timeout, FIRST_COMPLETED)
        broken = False
        for future in ended:
            job = self._flying.pop(future)
            try:
                self._take(job, future.result())
            except BrokenExecutor:
                broken = True
                self._lose(job)
            except CancelledError:
                self._ledger.release(job.key)
                raise SweepError("the cluster went away.", "Run the same sweep again when it is back.") from None
            except Exception as error:
                if type(error).__name__ != "KilledWorker":  # Dask's word for a process that died again and again
                    self._ledger.release(job.key)
                    raise
                self._lose(job)
        if broken:
            for job in self._flying.values():
                self._lose(job)
            self._flying.clear()
            self._restart()

    def _take(self, job: Job, outcome: Outcome) -> None:
        self._suspects.discard(job.key)
        if not self._shares_ledger:
            stop_mark(self._store.root, job.key).unlink(missing_ok=True)
        if outcome.state == "stopped":
            self._ledger.release(job.key)
            self._tell("lost", job)
        elif outcome.state == "failed":
            assert outcome.error is not None
            self._fail(job, outcome.error, ATTEMPTS if outcome.retry else 1)
        else:
            if not self._shares_ledger:
                self._ledger.done(job.key, outcome.digest, outcome.seconds)
            self._solved += not outcome.reused
            self._finished.add(job.key)
            self._tell("reused" if outcome.reused else "done", job, fraction=1.0, seconds=outcome.seconds)

    def _lose(self, job: Job) -> None:
        self._suspects.add(job.key)
        self._fail(job, _LOST, ATTEMPTS)

    def _fail(self, job: Job, error: Mapping[str, Any], attempts: int) -> None:
        state = self._ledger.failed(job.key, dict(error), attempts)
        if state in ("failed", "done"):  # done: its worker had stored and noted it before it died
            self._finished.add(job.key)
            self._suspects.discard(job.key)
            self._solved += state == "done"
        self._tell(state if state in ("failed", "done") else "retry", job, error=error)

    def _restart(self) -> None:
        restart = getattr(self._executor, "restart", None)
        if restart is None:
            raise SweepError("the executor's processes died.", "Run the same sweep again.")
        restart()

    def _attend(self) -> None:
        """Keep the books for workers that cannot, and show how far the running jobs are."""
        if not self._shares_ledger:
            for job in self._flying.values():
                if not self._ledger.renew(job.key, self._id, self._lease):
                    self._call_off(job.key)
        if self._observe is not None:
            for job in self._ledger.jobs("running"):
                if job.key in self._jobs and job.worker == self._id:
                    self._tell("progress", job, fraction=job.progress)

    def _call_off(self, key: str) -> None:
        """Tell a worker that cannot see the ledger that its job is no longer wanted."""
        mark = stop_mark(self._store.root, key)
        mark.parent.mkdir(exist_ok=True)
        mark.touch()

    def _elsewhere(self) -> bool:
        """Return whether another runner works on one of our jobs; if it dies, we shall claim it."""
        return any(job.key in self._jobs for state in ("wanted", "running") for job in self._ledger.jobs(state))

    def _land(self) -> None:
        """Give back what still runs: its workers notice at their next heartbeat."""
        if not self._flying:
            return
        if not self._shares_ledger:
            self._call_off(self._id)
        for future, job in self._flying.items():
            future.cancel()
            self._ledger.release(job.key)
        ended, _ = wait(self._flying, _GRACE)
        for future in ended:
            # one may have finished in the very moment; its shard counts
            if not future.cancelled() and future.exception() is None and future.result().state == "done":
                self._take(self._flying[future], future.result())
        self._flying.clear()
        stop_mark(self._store.root, self._id).unlink(missing_ok=True)

    def _states(self) -> dict[str, Job]:
        return {job.key: job for job in self._ledger.jobs() if job.key in self._jobs}

    def _tell(self, kind: Kind, job: Job, **more: Any) -> None:
        if self._observe is not None:
            self._observe(Event(kind, job.key, job.params, len(self._finished), len(self._jobs), **more))

    def _report(self, seconds: float) -> Report:
        states = self._states()
        done = sum(job.state == "done" for job in states.values())
        failed = [job for job in states.values() if job.state == "failed"]
        return Report(
            plan=self._name,
            total=len(self._jobs),
            solved=self._solved,
            reused=done - self._solved,
            failed=tuple(Failure(job.key, job.params, job.error or {}) for job in failed),
            waiting=sum(job.state in ("wanted", "running") for job in states.values()),
            cancelled=sum(job.state == "cancelled" for job in states.values()),
            seconds=seconds,
            stopped=self._stop.is_set(),
        )


def _spec(job: Job) -> JobSpec:
    return JobSpec(job.key, job.solver, job.version, job.params, job.need)


def _is_dead(worker: str | None) -> bool:
    """Return whether a runner was a process of this host that no longer exists. Of other hosts, leases tell."""
    host, _, rest = (worker or "").partition(":")
    pid = rest.partition(":")[0]
    if host != socket.gethostname() or not pid.isdigit():
        return False
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return False
