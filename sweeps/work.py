"""What a worker does with one job: solve it, put the shard on the disk, and say so. Runs in any process, on any host.

The shard is on the disk before anything is reported, so that nothing reported can be lost. A worker that loses its
job (cancelled, or taken over by another) finds out at its next heartbeat and stops through the solver's `Context`.
"""

from __future__ import annotations

import threading
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

import xarray as xr

from solver import registry
from solver.contract import Cancelled, Context, InvalidInput, Need, Solver, SolverError, finish
from store import shards
from store.errors import CorruptShard, StoreError
from store.ledger import JobSpec
from store.store import Store

from . import tabled
from .errors import SweepError, describe

__all__ = ["Outcome", "Task", "beat", "quarantine_path", "stop_mark", "work"]


@dataclass(frozen=True)
class Task:
    """One claimed job. `run` names the sweep that claimed it; `lease` [s] is how long it stays claimed.

    `shares_ledger` is false on other hosts, where SQLite's locks do not reach: there the claiming process keeps the
    books, and asks to stop by a mark beside the shards.
    """

    root: Path
    job: JobSpec
    run: str
    lease: float
    shares_ledger: bool = True


@dataclass(frozen=True)
class Outcome:
    """What became of a task. `reused`: the shard was there already. `error` as in `sweeps.errors.describe`."""

    key: str
    state: Literal["done", "failed", "stopped"]
    digest: str = ""
    seconds: float = 0.0
    reused: bool = False
    retry: bool = False
    error: dict[str, Any] | None = None


class StaleVersion(SweepError):
    """The worker's solver gives other numbers than the job asks for."""

    code = "other-version"


def beat(lease: float) -> float:
    """Return the seconds between two heartbeats: often enough to notice a cancellation, and to keep the lease."""
    return min(0.5, lease / 4)


def stop_mark(root: Path, name: str) -> Path:
    """Return the file whose presence asks the workers of a run, or that of a job's key, to stop."""
    return root / "stopping" / name


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
    try:
        digest = _stored(store, job.key)
        if digest is not None:
            return _report(store, task, Outcome(job.key, "done", digest, reused=True))
        with _Heart(task, store) as heart:
            digest = store.put(job.key, _solve(task, heart, store))
        return _report(store, task, Outcome(job.key, "done", digest, time.perf_counter() - start))
    except Cancelled:
        return Outcome(job.key, "stopped")
    except SolverError as error:
        said = describe(error)
        if error.partial is not None:
            said["partial"] = _quarantine(task, error.partial, str(error))
        # what is wrong with the question stays wrong; anything else deserves a second try
        return Outcome(job.key, "failed", retry=not isinstance(error, InvalidInput), error=said)
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
    context = Context(observe=heart.note, cancelled=heart.lost.is_set, library=store.find, shapes=tabled.shape)
    return solver.solve(solver.parse(task.job.params), Need.parse(task.job.need), context)


def _report(store: Store, task: Task, outcome: Outcome) -> Outcome:
    if task.shares_ledger:
        store.ledger.done(outcome.key, outcome.digest, outcome.seconds)
    return outcome


def _quarantine(task: Task, partial: xr.Dataset, reason: str) -> str:
    """Keep the stages that converged, with the reason, where no table looks for them; return the path in the store."""
    solver, path = registry.get(task.job.solver), quarantine_path(task.root, task.job.key)
    need = Need.parse(task.job.need)
    try:
        kept = finish(partial.copy(), solver, solver.parse(task.job.params), need)
    except (SolverError, KeyError):
        return ""  # not even its converged stages are sound
    shards.write(path, kept.assign_attrs(reason=reason), task.job.key)
    return str(path.relative_to(task.root))


class _Heart:
    """A thread that keeps the lease while the solver works, and learns when the job is lost."""

    def __init__(self, task: Task, store: Store) -> None:
        self._task, self._store = task, store
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
                if not self._alive():
                    self.lost.set()
                    return
            except Exception:  # a ledger that cannot be written now may be writable at the next beat
                continue

    def _alive(self) -> bool:
        task = self._task
        if not task.shares_ledger:
            return not any(stop_mark(task.root, name).exists() for name in (task.run, task.job.key))
        return self._store.ledger.renew(task.job.key, task.run, task.lease, *self._said)
