"""Local worker processes that end one by one: each job's can be killed, and one that dies takes no other with it."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple

__all__ = ["Processes"]

#: The kernel's word for "send me this signal when my parent ends".
_PR_SET_PDEATHSIG = 1

_SPAWN = multiprocessing.get_context("spawn")


class _Call(NamedTuple):
    future: Future[Any]
    said: bytes


class Processes(Executor):
    """`count` processes, started with their first call; each call runs alone in one of them.

    A process that dies, or whose answer cannot be read, fails the one call that it ran, with `BrokenExecutor`, and is
    replaced.
    """

    def __init__(self, count: int) -> None:
        self._calls: queue.SimpleQueue[_Call | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._running: dict[Future[Any], BaseProcess] = {}
        self._doomed: set[BaseProcess] = set()
        self._closed = False
        self._threads = [
            threading.Thread(target=self._attend, name=f"wizen-process-{i}", daemon=True) for i in range(count)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `fn` in the next process that is free."""
        if self._closed:
            raise RuntimeError("the processes were let go")
        future: Future[Any] = Future()
        self._calls.put(_Call(future, pickle.dumps((fn, args, kwargs))))
        return future

    def end(self, future: Future[Any]) -> None:
        """Kill the process that runs a call, whatever it does; the call fails with `BrokenExecutor`."""
        future.cancel()
        with self._lock:
            process = self._running.get(future)
            if process is not None:
                self._doomed.add(process)
                process.kill()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the processes go once they have done what was asked for."""
        self._closed = True
        if cancel_futures:
            with contextlib.suppress(queue.Empty):
                while True:
                    call = self._calls.get_nowait()
                    if call is not None:
                        call.future.cancel()
        for _ in self._threads:
            self._calls.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def _attend(self) -> None:
        """Hand calls to one process, and start another where it has died."""
        process: BaseProcess | None = None
        pipe: Connection | None = None
        while (call := self._calls.get()) is not None:
            if not call.future.set_running_or_notify_cancel():
                continue
            try:
                if process is None or pipe is None or not process.is_alive():
                    process, pipe = _start()
                result, error = self._ask(call, process, pipe)
            except (OSError, EOFError):
                result, error = None, BrokenExecutor("the worker process died")
                process = pipe = None
            except Exception as unread:  # whatever unpickling comes to: who waits for the call must hear of it
                result, error = None, BrokenExecutor(f"the answer of a worker process cannot be read ({unread!r})")
                process = pipe = None
            if error is None:
                call.future.set_result(result)
            else:
                call.future.set_exception(error)
        if pipe is not None and process is not None:
            pipe.close()
            process.join()

    def _ask(self, call: _Call, process: BaseProcess, pipe: Connection) -> tuple[Any, BaseException | None]:
        with self._lock:
            self._running[call.future] = process
        try:
            pipe.send_bytes(call.said)
            wait([pipe, process.sentinel])
            if not pipe.poll():
                raise EOFError
            answer: tuple[Any, BaseException | None] = pickle.loads(pipe.recv_bytes())
            return answer
        except Exception:
            process.kill()
            process.join()
            raise
        finally:
            with self._lock:
                del self._running[call.future]
                doomed = process in self._doomed
                self._doomed.discard(process)
            if doomed:
                process.join()  # it was killed, perhaps just after it had answered: nobody may ask it again


def _start() -> tuple[BaseProcess, Connection]:
    ours, theirs = _SPAWN.Pipe()
    process = _SPAWN.Process(target=_serve, args=(theirs, os.getpid()), name="wizen-worker", daemon=False)
    process.start()
    theirs.close()
    return process, ours


def _serve(pipe: Connection, parent: int) -> None:
    """Answer calls until the pipe is closed."""
    _settle_in(parent)
    while True:
        try:
            fn, args, kwargs = pickle.loads(pipe.recv_bytes())
        except EOFError:
            return
        try:
            answer = pickle.dumps((fn(*args, **kwargs), None))
        except BaseException as error:
            answer = _failure(error)
        pipe.send_bytes(answer)


def _failure(error: BaseException) -> bytes:
    try:
        said = pickle.dumps((None, error))
        pickle.loads(said)
        return said
    except Exception:  # an error that cannot travel, or that would not arrive
        return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))


def _settle_in(parent: int) -> None:
    """Make a new worker process deaf to Ctrl-C (the runner tells it what to do), and let it end with its parent.

    A parent that is killed cannot end its children, which would wait for work for ever and hold on to their job.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        # the kernel's word comes also while a compiled loop keeps our threads from running
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
    above = multiprocessing.parent_process()
    if above is not None:

        def follow() -> None:
            above.join()
            os._exit(1)

        threading.Thread(target=follow, name="wizen-follow-parent", daemon=True).start()
