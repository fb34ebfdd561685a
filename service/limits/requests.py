"""Limits on every request: length of the query, size and time of the body, time until the answer begins.

Plain ASGI, so that nothing is buffered and nothing is copied on the way through.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .. import problems
from ..errors import BodyTooLarge, QueryTooLong, ServiceError, SlowBody, TimedOut
from ..settings import Settings
from . import waited

__all__ = ["Limits"]

#: How often within `timeout` is looked whether there is a reason to be patient.
_LOOKS = 4


class Limits:
    """Refuses what is too long, and answers for a handler that takes too long; while `is_patient()`, none does."""

    def __init__(self, app: ASGIApp, settings: Settings, is_patient: Callable[[], bool] = lambda: False) -> None:
        self.app = app
        self.settings = settings
        self.is_patient = is_patient

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on within its limits."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        limit = self.settings
        if len(scope.get("query_string", b"")) > limit.max_query:
            error = QueryTooLong(
                f"the query is longer than {limit.max_query} bytes.", advice="A shape needs a dozen short parameters."
            )
            await problems.of(error, scope)(scope, receive, send)
            return
        declared = Headers(scope=scope).get("content-length", "0")
        if declared.isdigit() and int(declared) > limit.max_body:
            await problems.of(self._too_large(), scope)(scope, receive, send)
            return
        with waited.begin(scope) as wait:
            await self._watch(scope, receive, send, wait)

    async def _watch(self, scope: Scope, receive: Receive, send: Send, wait: waited.Wait) -> None:
        """Pass the request on while counting its body and its time; the first to run out gives the answer."""
        begun, received, whole = False, 0, False
        failure: ServiceError | None = None
        deadline = asyncio.get_running_loop().time() + self.settings.body_timeout

        async def counted() -> Message:
            nonlocal received, whole, failure
            try:
                # once the body is whole, what is received is that the asker has left: that may take any time
                async with asyncio.timeout_at(None if whole else deadline):
                    message = await receive()
            except TimeoutError:
                failure = self._too_slow()
                raise failure from None
            whole = not message.get("more_body", False)
            received += len(message.get("body", b""))
            if received > self.settings.max_body:
                failure = self._too_large()
                raise failure
            return message

        async def watched(message: Message) -> None:
            nonlocal begun
            if failure and not begun:
                return  # whoever read the body took it for a bad one
            begun = True
            timer.reschedule(None)  # a long answer may take its time once it has begun
            await send(message)

        try:
            async with asyncio.timeout(self.settings.timeout) as timer:
                with self._patience(timer):
                    await self.app(scope, counted, watched)
        except TimeoutError:
            if begun or not timer.expired():
                raise
            error = TimedOut(
                f"no answer began within {self.settings.timeout:g} s.",
                advice=wait.advice or "Try again, or ask for less resolution.",
            )
            wait.over.set()
            await problems.of(error, scope)(scope, receive, send)
        if failure and not begun:
            await problems.of(failure, scope)(scope, receive, send)

    @contextmanager
    def _patience(self, timer: asyncio.Timeout) -> Iterator[None]:
        """Put a timer off as long as `is_patient`: what happens once on a machine is no reason to send anybody away."""
        loop, limit = asyncio.get_running_loop(), self.settings.timeout
        next_look: asyncio.TimerHandle

        def look() -> None:
            nonlocal next_look
            if timer.when() is None:
                return  # the answer has begun
            if self.is_patient():
                timer.reschedule(loop.time() + limit)
            next_look = loop.call_later(limit / _LOOKS, look)

        next_look = loop.call_later(limit / _LOOKS, look)
        try:
            yield
        finally:
            next_look.cancel()

    def _too_slow(self) -> SlowBody:
        return SlowBody(f"the body did not arrive within {self.settings.body_timeout:g} s.", advice="Send it at once.")

    def _too_large(self) -> BodyTooLarge:
        return BodyTooLarge(f"the body is larger than {self.settings.max_body} bytes.", advice="Send less.")
