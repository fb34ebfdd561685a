"""Where jobs run: here, in local processes, or on Dask. All are `concurrent.futures.Executor`s to the runner.

Workers of one machine share its cores: each gets `cores // workers` threads, set before numerical libraries load,
unless the user has set `NUMBA_NUM_THREADS` and the like.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any

from ..errors import InvalidOption, SweepError, installing
from .processes import Processes

__all__ = ["SchedulerLost", "Workers", "choose", "cores", "dask_cluster", "dask_local", "processes", "serial"]

#: What numerical libraries read, once, when they are loaded.
_THREADS = (
    "NUMBA_NUM_THREADS",
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

#: How long a scheduler may take to answer.
_PATIENCE = "10s"


class NoScheduler(SweepError):
    """The Dask scheduler cannot be reached, or Dask is not installed."""

    code = "no-scheduler"


class SchedulerLost(SweepError):
    """The Dask scheduler went away in the middle."""

    code = "scheduler-lost"

    def __init__(self, where: str = "") -> None:
        at = f" at {where}" if where else ""
        super().__init__(
            f"the Dask scheduler{at} does not answer any more.",
            "What is stored stays; run the same command again when it is back.",
        )


def _call(fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
    return fn(*args, **kwargs)


def _call_on_dask(fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
    """Call `fn` as if there were no cluster around it.

    Otherwise xarray, seeing a Dask worker, asks the scheduler for a lock per file. Nobody shares our files: each is
    written by one process and appears by a rename.
    """
    import dask

    with dask.config.set(scheduler="synchronous"):
        return fn(*args, **kwargs)


class Workers(Executor):
    """An executor that knows how many jobs it takes at once, and how its jobs are ended.

    `shares_ledger` is false where workers are on other hosts and must not open the ledger. `ends_itself` is true where
    nobody here can kill a worker that does not stop when it should.
    """

    def __init__(
        self,
        inner: Executor,
        width: Callable[[], int],
        title: str,
        shares_ledger: bool = True,
        ends_itself: bool = False,
        wrap: Callable[..., Any] = _call,
    ) -> None:
        self._inner = inner
        self._width = width
        self.title = title
        self.shares_ledger = shares_ledger
        self.ends_itself = ends_itself
        self._wrap = wrap

    @property
    def width(self) -> int:
        """How many jobs run at once; a cluster may grow and shrink."""
        return max(1, self._width())

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `fn` on a worker."""
        return self._inner.submit(self._wrap, fn, *args, **kwargs)

    def end(self, future: Future[Any]) -> None:
        """Kill the process of a call that does not stop when it should, where it is a process of ours."""
        if isinstance(self._inner, Processes):
            self._inner.end(future)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the workers go."""
        # Dask's executor has no such argument; the runner leaves no futures behind
        self._inner.shutdown(wait=wait, **({"cancel_futures": True} if cancel_futures else {}))


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def serial() -> Iterator[Workers]:
    """One job at a time with all cores, in a thread of this process, for programs that have nothing else to do.

    A thread cannot be killed: a job that is taken back ends when its solver looks up.
    """
    with Workers(ThreadPoolExecutor(1, "wizen-solver"), lambda: 1, "this process") as workers:
        yield workers


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """`count` local processes.

    Raises:
        InvalidOption: `count` is not positive.

    """
    _positive(count)
    title = "one process" if count == 1 else f"{count} processes"
    with _environment(_threads(count)), Workers(Processes(count), lambda: count, title) as workers:
        yield workers


@contextmanager
def dask_local(count: int) -> Iterator[Workers]:
    """`count` local processes under a Dask cluster of this machine's own, with Dask's dashboard.

    Raises:
        InvalidOption: `count` is not positive.
        NoScheduler: Dask is not installed.

    """
    _positive(count)
    _need_dask()
    from distributed import LocalCluster

    with _environment(_threads(count)), _deaf_children():
        cluster = LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            env=_threads(count),
            dashboard_address="127.0.0.1:0",
            worker_dashboard_address=None,
        )
    with cluster, _client(cluster) as client:
        title = f"{count} Dask workers, dashboard {cluster.dashboard_link}"
        inner = client.get_executor(pure=False)
        with Workers(inner, lambda: count, title, ends_itself=True, wrap=_call_on_dask) as workers:
            yield workers


@contextmanager
def dask_cluster(address: str) -> Iterator[Workers]:
    """The workers of a running Dask scheduler. Those that see the store under the same path write results there; others
    hand them back. Jobs that start from other results need the former; only those stop when they are cancelled.

    The workers' threads are set where they are started (`dask worker --nthreads 1`, `OMP_NUM_THREADS`).

    Raises:
        NoScheduler: nobody answers at `address`, or Dask is not installed.

    """
    _need_dask()
    with _client(address) as client:
        inner, title = client.get_executor(pure=False), f"Dask scheduler {address}"
        width = partial(_width, client)
        with Workers(inner, width, title, shares_ledger=False, ends_itself=True, wrap=_call_on_dask) as workers:
            yield workers


@contextmanager
def choose(workers: int | None = None, dask: bool = False, scheduler: str | None = None) -> Iterator[Workers]:
    """The workers that the command line's options name: processes, which can be ended at any moment.

    Raises:
        InvalidOption: options that contradict each other.
        NoScheduler: the scheduler cannot be reached.

    """
    if scheduler is not None and (dask or workers is not None):
        raise InvalidOption("--scheduler brings its own workers.", "Drop --dask and --workers.")
    count = 1 if workers is None else workers
    _positive(count)
    if scheduler is not None:
        opened = dask_cluster(scheduler)
    elif dask:
        opened = dask_local(count)
    else:
        opened = processes(count)
    with opened as chosen:
        yield chosen


def _positive(count: int) -> None:
    if count < 1:
        raise InvalidOption(f"there cannot be {count} workers.", "Ask for at least one.")


def _threads(workers: int) -> dict[str, str]:
    """Return each worker's share of the cores; what the user has set stays as it is."""
    share = str(max(1, cores() // workers))
    return {name: os.environ.get(name, share) for name in _THREADS}


@contextmanager
def _environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set variables for the processes that are started meanwhile."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Let processes that are started meanwhile ignore Ctrl-C: the runner tells them what to do."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may change signals, and only it receives them
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _width(client: Any) -> int:
    """Return how many threads a cluster has.

    Raises:
        SweepError: its scheduler does not answer any more.

    """
    try:
        return len(client.nthreads())
    except Exception as error:  # distributed has a dozen ways to say that a connection is gone
        raise SchedulerLost(where=client.scheduler.address if client.scheduler else "") from error


def _need_dask() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise NoScheduler("Dask is not installed.", installing("cluster")) from None


@contextmanager
def _client(where: Any) -> Iterator[Any]:
    from distributed import Client
    from distributed.comm.addressing import get_address_host_port

    try:
        if isinstance(where, str):
            get_address_host_port(where)  # a client that finds it is no address waits for itself when it is let go
        client = Client(where, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        advice = "Start one with `dask scheduler`, and name it as in tcp://10.0.0.1:8786."
        raise NoScheduler(f"no Dask scheduler answers at {where} ({error}).", advice) from error
    loggers = [logging.getLogger(name) for name in ("distributed.client", "asyncio", "tornado.application")]
    for logger in loggers:
        logger.addFilter(_is_news)
    try:
        with client:
            yield client
    finally:
        for logger in loggers:
            logger.removeFilter(_is_news)


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether Dask's client says more than that its connection is gone, which is said in a sentence."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, OSError | TimeoutError | asyncio.CancelledError)
