"""Two pieces of work side by side: the same sums in the same order as one after the other, so the same bytes.

Threads of their own, not numba's: those start once and outlive what asked for them, which a fork does not survive. One
that starts takes some tens of microseconds; the work must be that of code which lets other threads in (compiled with
`nogil`, or called by ctypes).
"""

from __future__ import annotations

import contextvars
import threading
from collections.abc import Callable, Generator
from typing import TypeVar

from numba import config

__all__ = ["abreast", "both", "finished", "two"]

A = TypeVar("A")
B = TypeVar("B")


def two() -> bool:
    """Return whether two threads may be used: NUMBA_NUM_THREADS, by default the number of cores."""
    return bool(config.NUMBA_NUM_THREADS > 1)  # type: ignore[attr-defined]  # from the environment, as it loads


def both(here: Callable[[], A], there: Callable[[threading.Event], B]) -> tuple[A, B]:
    """Return what both return; `there` is called on a thread of its own.

    `there` is handed what is set once `here` has failed, or whoever waits for `there` was interrupted, so that it may
    leave off. What `here` raises goes before what `there` raises. Where the system has no thread left, or the
    interpreter is about to end, one comes after the other.
    """
    ended = threading.Event()
    found: list[B] = []
    failed: list[BaseException] = []

    def work() -> None:
        try:
            found.append(there(ended))
        except BaseException as error:  # it is raised again where somebody waits for it
            failed.append(error)

    # what numpy does of an overflow is said for a context, and a thread begins with one of its own
    thread = threading.Thread(target=contextvars.copy_context().run, args=(work,), name="wizen-abreast")
    try:
        if not _starts(thread):
            return here(), there(ended)
        own = here()
        thread.join()
    except BaseException:
        ended.set()
        if thread.is_alive():
            thread.join()
        failed.clear()  # an error that its own frames know keeps all that they hold
        raise
    if failed:
        raise failed.pop()
    return own, found[0]


def _starts(thread: threading.Thread) -> bool:
    try:
        thread.start()
    except RuntimeError:
        return False
    return True


def abreast(first: Generator[None, None, A], second: Generator[None, None, B]) -> Generator[None, None, tuple[A, B]]:
    """Go on with both generators, a piece of each at a time; the value is both of theirs."""
    if not two():
        return (yield from first), (yield from second)
    while True:
        one, other = both(lambda: _ended(first), lambda _: _ended(second))
        if one and other:
            return one[0], other[0]
        # whichever is longer goes on alone
        if one:
            return one[0], (yield from second)
        if other:
            return (yield from first), other[0]
        yield


def finished(work: Generator[object, None, A]) -> A:
    """Go on with a generator to its end; returns its value."""
    while not (end := _ended(work)):
        pass
    return end[0]


def _ended(work: Generator[object, None, A]) -> tuple[A] | None:
    """Go on with a generator for a piece; returns its value once there is one."""
    try:
        next(work)
    except StopIteration as end:
        return (end.value,)
    return None
