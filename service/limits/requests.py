"""Limits on every request: length of the query, size and time of the body, time until the answer begins.

Plain ASGI, so that nothing is buffered and nothing is copied on the way through.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

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
        declared = next((value for name, value in scope["headers"] if name == b"content-length"), b"0")
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
            patience.end()  # a long answer may take its time once it has begun
            await send(message)

        try:
            async with asyncio.timeout(None) as timer:
                patience = _Patience(timer, self.settings.timeout, self.is_patient)
                try:
                    await self.app(scope, counted, watched)
                finally:
                    patience.stop()
        except TimeoutError:
            if begun or not timer.expired():
                raise
            error = TimedOut(
                f"no answer began within {self.settings.timeout:g} s.",
                advice=wait.advice or "Try again, or ask for less resolution.",
            )
            wait.over = True
            await problems.of(error, scope)(scope, receive, send)
        if failure and not begun:
            await problems.of(failure, scope)(scope, receive, send)

    def _too_slow(self) -> SlowBody:
        return SlowBody(f"the body did not arrive within {self.settings.body_timeout:g} s.", advice="Send it at once.")

    def _too_large(self) -> BodyTooLarge:
        return BodyTooLarge(f"the body is larger than {self.settings.max_body} bytes.", advice="Send less.")


class _Patience:
    """Lets a timer go off after `limit` seconds, put off as long as `is_patient`: what happens once on a machine is no
    reason to send anybody away.

    One timer of the loop looks and ends the wait: nearly every answer begins before its first look.
    """

    def __init__(self, timer: asyncio.Timeout, limit: float, is_patient: Callable[[], bool]) -> None:
        self._timer, self._limit, self._is_patient = timer, limit, is_patient
        self._loop = loop = asyncio.get_running_loop()
        self._until = loop.time() + limit
        self._next = loop.call_later(limit / _LOOKS, self._look)

    def _look(self) -> None:
        now, limit = self._loop.time(), self._limit
        if self._is_patient():
            self._until = now + limit
        if now >= self._until:
            self._timer.reschedule(now)
        else:
            self._next = self._loop.call_at(min(now + limit / _LOOKS, self._until), self._look)

    def stop(self) -> None:
        """Look no more."""
        self._next.cancel()

    def end(self) -> None:
        """Wait as long as it takes from now on."""
        self.stop()
        if self._timer.when() is not None:
            self._timer.reschedule(None)
