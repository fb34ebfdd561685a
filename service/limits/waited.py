"""Whether anybody still waits for what is being computed: an answer that nobody gets is not worth finishing.

`Limits` opens a wait for every request and closes it when the answer has been given, in time or not;
`GuardedProtocol` closes it when the other end has left. Whatever takes long asks `check` in between, in the thread
where it runs: threads are given the context of the request that began them.
"""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from contextvars import ContextVar, Token
from typing import Any, Self

from ..errors import TimedOut

__all__ = ["Wait", "begin", "check", "end"]

_NAME = "wizen.wait"


class Wait:
    """Somebody's wait for an answer, as a context: `over` once he waits no more; `advice` is for him if it takes too
    long. Threads read what the event loop sets.
    """

    __slots__ = ("_token", "advice", "over")

    def __init__(self) -> None:
        self.over, self.advice = False, ""

    def __enter__(self) -> Self:
        self._token: Token[Wait | None] = _wait.set(self)
        return self

    def __exit__(self, *reason: object) -> None:
        self.over = True
        _wait.reset(self._token)


_wait: ContextVar[Wait | None] = ContextVar("wait", default=None)


def begin(scope: MutableMapping[str, Any]) -> Wait:
    """Return a wait for the answer to a request, which begins when it is entered."""
    wait = scope[_NAME] = Wait()
    return wait


def end(scope: Mapping[str, Any]) -> None:
    """Wait no more: whoever asked has left."""
    if (wait := scope.get(_NAME)) is not None:
        wait.over = True


def check(advice: str = "") -> None:
    """Go on if somebody waits, or nobody ever asked (on a command line); `advice` is what to say if it gets too late.

    Raises:
        TimedOut: nobody waits.

    """
    if (wait := _wait.get()) is None:
        return
    wait.advice = advice or wait.advice
    if wait.over:
        raise TimedOut("nobody waits for this any more.", advice=wait.advice or "Ask again.")
