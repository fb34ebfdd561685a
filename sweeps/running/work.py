"""What a worker does with one job: solve it, put the shard on the disk, and say so. Runs in any process, on any host.

The shard is on the disk before anything is reported, so that nothing reported can be lost. A worker that loses its
claim (cancelled, or taken over by another) finds out at its next heartbeat and stops through the solver's `Context`;
one whose solver does not listen is ended: by its runner where that can, else by itself.
"""

from __future__ import annotations

import os
import threading
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

import xarray as xr

from solver import registry
from solver.contract import Cancelled, Context, InvalidInput, Need, Solver, SolverError, Unstable, finish
from store import shards, starter
from store.errors import CorruptShard, StoreError
from store.ledger.jobs import Job, JobSpec
from store.store import Store

from .. import tabled
from ..errors import SweepError, describe
from ..relaxing import starts

__all__ = ["GRACE", "Hold", "Outcome", "Task", "beat", "quarantine_path", "stop_mark", "work"]

#: Seconds that a solver gets to stop by itself once it was asked to.
GRACE = 0.7


@dataclass(frozen=True)
class Task:
    """One claimed job, as the ledger handed it out; `lease` [s] is how long it stays claimed.

    `shares_ledger` is false on other hosts, where SQLite's locks do not reach: there the claiming process keeps the
    books, and asks to stop by a mark beside the shards. `ends_itself`: nobody else can kill the worker's process.
    `sharing` names a file in the store that the claiming process sees: a worker that does not see it hands its result
    back as bytes.
    """

    root: Path
    job: Job
    lease: float
    shares_ledger: bool = True
    ends_itself: bool = False
    sharing: str = ""

    @property
    def apart(self) -> bool:
        """Whether the store's files are not to be seen from here."""
        return bool(self.sharing) and not (self.root / self.sharing).exists()


@dataclass(frozen=True)
class Outcome:
    """What became of a task. `reused`: the shard was there already. `error` as in `sweeps.errors.describe`.

    `data` is the result itself where its worker could not store it.
    """

    key: str
    state: Literal["done", "failed", "stopped"]
    digest: str = ""
    seconds: float = 0.0
    reused: bool = False
    retry: bool = False
    error: dict[str, Any] | None = None
    data: bytes = b""


class StaleVersion(SweepError):
    """The worker's solver gives other numbers than the job asks for."""

    code = "other-version"


def beat(lease: float) -> float:
    """Return the seconds between two heartbeats: often enough to notice a cancellation, and to keep the lease."""
    return min(0.5, lease / 4)


def stop_mark(root: Path, job: Job) -> Path:
    """Return the file whose presence asks the worker of one claim to stop."""
    return root / "stopping" / f"{job.key}-{job.claims}"


def quarantine_path(root: Path, key: str) -> Path:
    """Return where the stages are kept that a failed run did converge."""
    return root / "quarantine" / f"{key}.h5"


def work(task: Task) -> Outcome:
    """Compute one job; what the solver refuses or fails at is an outcome, what the store cannot do is raised.

    Raises:
        StoreError: the disk is full or the ledger is damaged; the job is not to blame.
        OSError: the file system fails in another way.

    """
    store = Store(task.root)
    job, start = task.job, time.perf_counter()
    hold = Hold(task, store)
    try:
        if not hold.keep():
            return Outcome(job.key, "stopped")  # it was taken back while it waited here
        digest = _stored(store, job.key)
        if digest is not None:
            return hold.report(Outcome(job.key, "done", digest, reused=True))
        with _Heart(task, hold) as heart:
            # a pattern that comes with the package might come out otherwise here
            result = starter.result(job.key)
            if result is None:
                result = _solve(task, heart, store)
            if task.apart:
                digest, data = shards.image(result, job.key)
                return Outcome(job.key, "done", digest, time.perf_counter() - start, data=bytes(data))
            digest = store.put(job.key, result)
        return hold.report(Outcome(job.key, "done", digest, time.perf_counter() - start))
    except Cancelled:
        return Outcome(job.key, "stopped")
    except SolverError as error:
        said = describe(error)
        if error.partial is not None:
            said["partial"] = _quarantine(task, error.partial, str(error))
        # what is wrong with the question stays wrong, and what blew up does so again: the same run gives the same bytes
        return Outcome(job.key, "failed", retry=not isinstance(error, InvalidInput | Unstable), error=said)
    except StaleVersion as error:
        return Outcome(job.key, "failed", error=describe(error))
    except MemoryError:
        advice = "Use fewer workers, or a coarser quality."
        said = {"code": "out-of-memory", "message": "the memory did not suffice.", "advice": advice}
        return Outcome(job.key, "failed", retry=True, error=said)
    except (StoreError, OSError):
        raise
    except Exception as error:  # a defect of one solver must not take the other jobs down with it
        said = describe(error) | {"traceback": traceback.format_exc()}
        return Outcome(job.key, "failed", retry=True, error=said)
    finally:
        if task.shares_ledger:
            store.ledger.close()


def _stored(store: Store, key: str) -> str | None:
    try:
        return store.get(key).attrs["digest"] if store.has(key) else None
    except CorruptShard:
        return None


def _solver(job: JobSpec) -> Solver:
    solver = registry.get(job.solver)
    if solver.version != job.version:
        raise StaleVersion(
            f"the job asks for {job.solver} version {job.version}, this worker has {solver.version}.",
            "Install the same wizen on every worker, or sweep again with this one.",
        )
    return solver


def _solve(task: Task, heart: _Heart, store: Store) -> xr.Dataset:
    solver = _solver(task.job)
    context = Context(
        observe=heart.note, cancelled=heart.lost.is_set, library=store.find, shapes=tabled.shape, starts=starts(store)
    )
    return solver.solve(solver.parse(task.job.params), Need.parse(task.job.need), context)


def _quarantine(task: Task, partial: xr.Dataset, reason: str) -> str:
    """Keep the stages that converged, with the reason, where no table looks for them; return the path in the store."""
    if task.apart:
        return ""  # there is nowhere to keep them
    solver, path = registry.get(task.job.solver), quarantine_path(task.root, task.job.key)
    need = Need.parse(task.job.need)
    try:
        kept = finish(partial.copy(), solver, solver.parse(task.job.params), need)
    except (SolverError, KeyError):
        return ""  # not even its converged stages are sound
    shards.write(path, kept.assign_attrs(reason=reason), task.job.key)
    return str(path.relative_to(task.root))


class Hold:
    """The claim on a job as its worker has it."""

    def __init__(self, task: Task, store: Store) -> None:
        self._task, self._store = task, store

    def keep(self, progress: float | None = None, message: str = "") -> bool:
        """Renew the lease; return whether the claim is still ours."""
        task = self._task
        if not task.shares_ledger:
            return not stop_mark(task.root, task.job).exists()
        return self._store.ledger.renew(task.job, task.lease, progress, message)

    def report(self, outcome: Outcome) -> Outcome:
        """Note that the result is stored; return the outcome, which is "stopped" where the claim was lost meanwhile."""
        if not self._task.shares_ledger or self._store.ledger.done(self._task.job, outcome.digest, outcome.seconds):
            return outcome
        return Outcome(outcome.key, "stopped")


class _Heart:
    """A thread that keeps the lease while the solver works, and learns when the job is lost."""

    def __init__(self, task: Task, hold: Hold) -> None:
        self._task, self._hold = task, hold
        self._said = 0.0, ""
        self._finished = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wizen-heartbeat", daemon=True)
        self.lost = threading.Event()

    def note(self, fraction: float, message: str) -> None:
        """Remember the progress for the next beat."""
        self._said = fraction, message

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *reason: object) -> None:
        self._finished.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._finished.wait(beat(self._task.lease)):
            try:
                if self._hold.keep(*self._said):
                    continue
            except Exception:  # a ledger that cannot be written now may be writable at the next beat
                continue
            self.lost.set()
            if self._task.ends_itself and not self._finished.wait(GRACE):
                os._exit(1)  # whatever it does is of no use to anybody; nothing half-written is ever visible
            return
