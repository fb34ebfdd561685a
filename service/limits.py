"""Limits on every request: length of the query, size of the body, time until the answer begins.

Plain ASGI, so that nothing is buffered and nothing is copied on the way through.
"""

from __future__ import annotations

import asyncio

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from . import problems
from .errors import BodyTooLarge, QueryTooLong, TimedOut
from .settings import Settings

__all__ = ["Limits"]


class Limits:
    """Refuses what is too long, and answers for a handler that takes too long."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.settings = settings

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
        await self._watch(scope, receive, send)

    async def _watch(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on while counting its body and its time; the first to run out gives the answer."""
        begun, received = False, 0

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > self.settings.max_body:
                # whoever reads the body may take this for a bad one; `watched` then drops what he answers
                raise self._too_large()
            return message

        async def watched(message: Message) -> None:
            nonlocal begun
            if received > self.settings.max_body and not begun:
                return
            begun = True
            timer.reschedule(None)  # a long answer may take its time once it has begun
            await send(message)

        try:
            async with asyncio.timeout(self.settings.timeout) as timer:
                await self.app(scope, counted, watched)
        except TimeoutError:
            if begun or not timer.expired():
                raise
            error = TimedOut(
                f"no answer began within {self.settings.timeout:g} s.", advice="Try again, or ask for less resolution."
            )
            await problems.of(error, scope)(scope, receive, send)
        if received > self.settings.max_body and not begun:
            await problems.of(self._too_large(), scope)(scope, receive, send)

    def _too_large(self) -> BodyTooLarge:
        return BodyTooLarge(f"the body is larger than {self.settings.max_body} bytes.", advice="Send less.")
