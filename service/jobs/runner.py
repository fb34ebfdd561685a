"""Runs the queue's jobs beside the service: of all processes over one store, one at a time does it, in a thread.

The solvers themselves run in other processes, which are started with the first job and let go when none has come for
a while, so that a service that only looks up shapes stays small.
"""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from store.ledger.queue import Queue
from store.starter import ROOT as STARTER
from store.store import Store

from ..settings import Settings
from ..telemetry import LOGGER

if TYPE_CHECKING:
    from sweeps.running.executors import Workers

__all__ = ["JobRunner"]

#: Seconds between two looks into the queue while there is nothing to do.
_LOOK = 0.5
#: Seconds without a job after which worker processes are let go.
_PATIENCE = 60.0
#: Seconds to wait after something went wrong that is not a job's fault: at first, and at most.
_PAUSE, _LONGEST_PAUSE = 1.0, 60.0


class JobRunner:
    """A thread that works off the queue while the service runs."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wizen-jobs", daemon=True)

    @property
    def wanted(self) -> bool:
        """Whether the settings ask this service to run jobs, and its store takes any."""
        chosen = self._settings
        works = chosen.jobs_workers > 0 or chosen.scheduler is not None
        return works and chosen.store.resolve() != STARTER.resolve()

    def start(self) -> None:
        """Begin to work."""
        self._thread.start()

    def halt(self) -> None:
        """Stop working; running jobs go back into the queue."""
        self._stop.set()

    def stop(self) -> None:
        """Stop working and wait for it."""
        self.halt()
        self._thread.join()

    def _run(self) -> None:
        pause = _PAUSE
        while not self._stop.wait(_LOOK):
            try:
                if not self._has_work():
                    continue
                with _alone(self._settings.store) as alone:
                    if alone:
                        self._work()
                pause = _PAUSE
            except Exception:
                # a full disk, a scheduler that is away: the jobs wait, the service goes on
                LOGGER.exception("jobs: trying again in %g s", pause)
                self._stop.wait(pause)
                pause = min(2 * pause, _LONGEST_PAUSE)

    def _has_work(self) -> bool:
        store = Store(self._settings.store)
        if not store.ledger.path.is_file():
            return False
        try:
            return bool(Queue(store.ledger).waiting())
        finally:
            store.ledger.close()

    def _work(self) -> None:
        from sweeps.running.runner import run_queue

        with self._workers() as workers:
            LOGGER.info("jobs: running on %s", workers.title)
            run_queue(Store.open(self._settings.store), workers, self._stop, _PATIENCE)

    def _workers(self) -> AbstractContextManager[Workers]:
        from sweeps.running import executors

        if self._settings.scheduler is not None:
            return executors.dask_cluster(self._settings.scheduler)
        return executors.processes(self._settings.jobs_workers)


@contextmanager
def _alone(root: Path) -> Iterator[bool]:
    """Hold the right to run jobs of a store for the service's processes of this host; yield whether it was free.

    The system gives it back when its holder dies, however that happens.
    """
    handle = os.open(root / "service.lock", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(handle)
