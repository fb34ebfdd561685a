"""Whether anybody still waits for what is being computed: an answer that nobody gets is not worth finishing.

`Limits` opens a wait for every request and closes it when the answer has been given, in time or not;
`GuardedProtocol` closes it when the other end has left. Whatever takes long asks `check` in between, in the thread
where it runs: threads are given the context of the request that began them.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from ..errors import TimedOut

__all__ = ["Wait", "begin", "check", "end"]

_NAME = "wizen.wait"


class Wait:
    """Somebody's wait for an answer; `advice` is for him if it takes too long."""

    def __init__(self) -> None:
        self.over, self.advice = threading.Event(), ""


_wait: ContextVar[Wait | None] = ContextVar("wait", default=None)


@contextmanager
def begin(scope: MutableMapping[str, Any]) -> Iterator[Wait]:
    """Wait for the answer to a request."""
    wait = scope[_NAME] = Wait()
    token = _wait.set(wait)
    try:
        yield wait
    finally:
        wait.over.set()
        _wait.reset(token)


def end(scope: MutableMapping[str, Any]) -> None:
    """Wait no more: whoever asked has left."""
    if (wait := scope.get(_NAME)) is not None:
        wait.over.set()


def check(advice: str = "") -> None:
    """Go on if somebody waits, or nobody ever asked (on a command line); `advice` is what to say if it gets too late.

    Raises:
        TimedOut: nobody waits.

    """
    if (wait := _wait.get()) is None:
        return
    wait.advice = advice or wait.advice
    if wait.over.is_set():
        raise TimedOut("nobody waits for this any more.", advice=wait.advice or "Ask again.")
