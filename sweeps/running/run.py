"""One runner, step by step: what it claims, hands out, takes in and gives back. `sweeps.running.runner` lets it run.

Its steps are generators that yield how long to wait for a result at most, so that a simulation can drive the very
same code by a clock of its own.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from typing import Any

from store import shards
from store.errors import StoreError, UnknownJob
from store.ledger.jobs import Job, JobSpec
from store.ledger.queue import Queue
from store.store import Store

from ..errors import SweepError
from .executors import SchedulerLost
from .place import Place
from .report import Event, Failure, Kind, Report
from .work import GRACE, Outcome, Task, beat, stop_mark, work

__all__ = ["ATTEMPTS", "Run"]

#: How often a job is tried; what cannot succeed (invalid input) is tried once.
ATTEMPTS = 2
#: Seconds that workers get to stop when their runner does, twice a heartbeat; what they would finish the next run does.
_LANDING = 1.0
#: Seconds between two looks at workers that were asked to stop.
_SOON = 0.1

_LOST = {
    "code": "worker-lost",
    "message": "the worker process died while computing this.",
    "advice": "Often the memory did not suffice: use fewer workers or a coarser quality.",
}


class Run:
    """A runner of `jobs`, or (`drain`) of a store's queue. `now` is a clock that goes on evenly [s]."""

    def __init__(
        self,
        jobs: Iterable[JobSpec],
        store: Store,
        executor: Executor,
        name: str,
        observe: Callable[[Event], None] | None,
        lease: float,
        stop: threading.Event,
        now: Callable[[], float],
        place: Place | None = None,
    ) -> None:
        self._jobs: Mapping[str, JobSpec] = {job.key: job for job in jobs}
        self._store, self._ledger = store, store.ledger
        self._executor, self._name, self._observe = executor, name, observe
        self._lease, self._stop, self._now = lease, stop, now
        self._place = place or Place.here()
        self.id = self._place.sign()
        self._shares_ledger: bool = getattr(executor, "shares_ledger", True)
        self.flying: dict[Future[Outcome], Job] = {}
        #: When jobs were asked to stop that are not ours any more.
        self._called_off: dict[Future[Outcome], float] = {}
        self._finished: set[str] = set()
        self.solved = 0

    def rounds(self, again: bool = False) -> Iterator[float]:
        """Run the jobs until each is done or given up, or until the runner is to stop."""
        self._prepare(again)
        while not self._stop.is_set():
            self._launch()
            if not self.flying and not self._elsewhere():
                if len(self._states()) == len(self._jobs):
                    return
                self._prepare(again)  # somebody deleted the ledger meanwhile
                continue
            yield self._pause
            self._collect()
            self._attend()

    def drain(self, patience: float) -> Iterator[float]:
        """Run what is asked for in the queue, until nothing has come for `patience` [s]."""
        queue = Queue(self._ledger)
        busy = self._now()
        while not self._stop.is_set():
            waiting = queue.waiting()
            self._jobs = {job.key: job for job in waiting}
            self._free(waiting)
            self._launch()
            if self.flying:
                busy = self._now()
            elif self._now() - busy >= patience:
                return
            yield self._pause
            self._collect()
            self._attend()

    @property
    def _pause(self) -> float:
        """How long to wait for a result [s]; what was called off is ended on time, and not at the next heartbeat."""
        return min(_SOON, beat(self._lease)) if self._called_off else beat(self._lease)

    def landing(self) -> Iterator[float]:
        """Give back what still runs and wait for its workers; those that do not stop in time are ended."""
        for future, job in self.flying.items():
            future.cancel()
            with suppress(StoreError):  # what cannot be noted now is free when its lease has run out
                self._ledger.release(job)
            self._call_off(future, job)
        until = self._now() + _LANDING
        while (patience := until - self._now()) > 0 and not all(future.done() for future in self.flying):
            yield min(patience, beat(self._lease))
        for future, job in self.flying.items():
            if not future.done():
                self._end(future)
            # one may have finished in the very moment; its shard counts
            elif not future.cancelled() and future.exception() is None and future.result().state == "done":
                self._take(job, future.result())
            if future.done():
                stop_mark(self._store.root, job).unlink(missing_ok=True)
        self.flying.clear()
        if not self._shares_ledger:
            (self._store.root / self._sharing()).unlink()

    def _free(self, jobs: Iterable[Job]) -> bool:
        """Take back jobs of runners that are known to be dead; return whether there were any."""
        dead = [job for job in jobs if job.state == "running" and self._place.knows_dead(job.worker)]
        for job in dead:
            self._ledger.lost(job)
        return bool(dead)

    def _prepare(self, again: bool) -> None:
        """Enter the jobs, take back those of dead runners, and make the ledger agree with the shards."""
        self._ledger.want(self._jobs.values(), self._name, again=again)
        before = self._states()
        if any(job.state == "done" and not self._store.has(job.key) for job in before.values()):
            self._ledger.rebuild(self._store.results())  # shards were deleted by hand
            before = self._states()
        # of what was given up, another store's results may have been copied in since
        here = [job for job in before.values() if job.state == "failed" and self._store.has(job.key)]
        if here and self._ledger.want(here, self._name, again=True):
            before = self._states()
        if self._free(before.values()):
            before = self._states()  # what took its runners down too often was given up
        self._finished = {key for key, job in before.items() if job.state in ("done", "failed")}

    def _launch(self) -> None:
        width = getattr(self._executor, "width", 1)
        while len(self.flying) < width:
            job = self._ledger.claim(self.id, self._lease, self._jobs.keys())
            if job is None:
                return
            ends_itself = getattr(self._executor, "ends_itself", False)
            root = self._store.root.absolute()
            task = Task(root, job, self._lease, self._shares_ledger, ends_itself, self._sharing())
            try:
                self.flying[self._executor.submit(work, task)] = job
            except BrokenExecutor:
                self._ledger.release(job)
                raise SweepError("the executor's processes died.", "Run the same sweep again.") from None
            self._tell("started", job)

    def _sharing(self) -> str:
        """Return the name of a file by which workers elsewhere learn whether they see this store."""
        if self._shares_ledger:
            return ""
        mark = self._store.root / "stopping" / f"shared-{self.id.rpartition(':')[2]}"
        mark.parent.mkdir(exist_ok=True)
        mark.touch()
        return f"stopping/{mark.name}"

    def _collect(self) -> None:
        """Take in the results that are there."""
        for future in [future for future in self.flying if future.done()]:
            job = self.flying.pop(future)
            called_off = self._called_off.pop(future, None) is not None
            stop_mark(self._store.root, job).unlink(missing_ok=True)
            try:
                outcome = future.result()
            except (BrokenExecutor, CancelledError) as error:
                if called_off:
                    self._take(job, Outcome(job.key, "stopped"))
                elif isinstance(error, BrokenExecutor):
                    self._fail(job, _LOST, ATTEMPTS)
                else:
                    self._ledger.release(job)
                    raise SchedulerLost from None
            except Exception as error:
                # Dask's words for a process that died again and again, and for a scheduler that is gone
                match type(error).__name__:
                    case "KilledWorker" if called_off:
                        self._take(job, Outcome(job.key, "stopped"))
                    case "KilledWorker":
                        self._fail(job, _LOST, ATTEMPTS)
                    case kind:
                        self._ledger.release(job)
                        if kind in ("FutureCancelledError", "CommClosedError"):
                            raise SchedulerLost from error
                        raise
            else:
                self._take(job, outcome)

    def _take(self, job: Job, outcome: Outcome) -> None:
        if outcome.state == "done" and not self._shares_ledger:
            if outcome.data:  # its worker does not see the store
                self._store.put(job.key, shards.parse(outcome.data, self._store.shard_path(job.key)))
            ours = self._ledger.done(job, outcome.digest, outcome.seconds)
        else:
            ours = outcome.state == "done"
        if outcome.state == "failed":
            assert outcome.error is not None
            self._fail(job, outcome.error, ATTEMPTS if outcome.retry else 1)
        elif ours:
            self.solved += not outcome.reused
            self._finished.add(job.key)
            self._tell("reused" if outcome.reused else "done", job, fraction=1.0, seconds=outcome.seconds)
        else:
            self._ledger.release(job)
            self._tell("lost", job)

    def _fail(self, job: Job, error: Mapping[str, Any], attempts: int) -> None:
        state = self._ledger.failed(job, error, attempts)
        if state == "done":  # its worker had stored and noted it before it died
            self.solved += 1
        if state in ("failed", "done"):
            self._finished.add(job.key)
            self._tell(state, job, error=error)
        else:
            self._tell("lost" if state is None else "retry", job, error=error)

    def _attend(self) -> None:
        """Keep the books for workers that cannot, call off what is no longer ours, and show how far the rest is."""
        held = self._held()
        for future, job in self.flying.items():
            if job.key in held:
                self._tell("progress", job, fraction=held[job.key].progress)
            elif not future.done():
                self._call_off(future, job)
                if self._now() - self._called_off[future] > GRACE:
                    self._end(future)

    def _held(self) -> dict[str, Job]:
        """Return the flying jobs that are still ours; those that have just ended, too."""
        if not self._shares_ledger:
            return {job.key: job for job in self.flying.values() if self._ledger.renew(job, self._lease)}
        found = {job.key: job for job in self._ledger.running(self.id)}
        held = {}
        for job in self.flying.values():
            with suppress(UnknownJob):  # somebody deleted the ledger meanwhile
                now = found.get(job.key) or self._ledger.get(job.key)
                if now.claims == job.claims and now.state in ("running", "done"):
                    held[job.key] = now
        return held

    def _call_off(self, future: Future[Outcome], job: Job) -> None:
        """Tell a worker that its job is no longer wanted; those that see the ledger learn it there."""
        if future in self._called_off:
            return
        self._called_off[future] = self._now()
        if not self._shares_ledger:
            mark = stop_mark(self._store.root, job)
            mark.parent.mkdir(exist_ok=True)
            mark.touch()

    def _end(self, future: Future[Outcome]) -> None:
        end = getattr(self._executor, "end", None)
        if end is not None:
            end(future)

    def _elsewhere(self) -> bool:
        """Return whether another runner works on one of our jobs; if it dies, we shall claim it."""
        return any(job.key in self._jobs for state in ("wanted", "running") for job in self._ledger.jobs(state))

    def _states(self) -> dict[str, Job]:
        return {job.key: job for job in self._ledger.jobs() if job.key in self._jobs}

    def _tell(self, kind: Kind, job: Job, **more: Any) -> None:
        if self._observe is not None:
            self._observe(Event(kind, job.key, job.params, len(self._finished), len(self._jobs), **more))

    def report(self, seconds: float) -> Report:
        """Return what was achieved."""
        states = self._states()
        done = sum(job.state == "done" for job in states.values())
        failed = [job for job in states.values() if job.state == "failed"]
        return Report(
            plan=self._name,
            total=len(self._jobs),
            solved=self.solved,
            reused=done - self.solved,
            failed=tuple(Failure(job.key, dict(job.params), job.error or {}) for job in failed),
            waiting=sum(job.state in ("wanted", "running") for job in states.values()),
            cancelled=sum(job.state == "cancelled" for job in states.values()),
            seconds=seconds,
            stopped=self._stop.is_set(),
        )
