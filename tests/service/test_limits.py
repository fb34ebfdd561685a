"""Limits around an app that is not there: what it says, and when."""

from __future__ import annotations

import asyncio
from typing import Any

from starlette.types import Message, Receive, Scope, Send

from service.limits.requests import Limits
from service.settings import Settings

SCOPE: dict[str, Any] = {"type": "http", "method": "GET", "path": "/v1", "query_string": b"", "headers": []}


def said(app: Any, settings: Settings) -> list[Message]:
    """Return what is sent to somebody who asks an app within limits."""
    sent: list[Message] = []

    async def receive() -> Message:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Message) -> None:
        sent.append(message)

    asyncio.run(Limits(app, settings)(SCOPE, receive, send))
    return sent


def test_an_answer_that_has_begun_may_take_longer_than_one_may_wait_for_it() -> None:
    async def drip(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for part in range(4):
            await asyncio.sleep(0.1)
            await send({"type": "http.response.body", "body": b"%d" % part, "more_body": part < 3})

    async def wait(scope: Scope, receive: Receive, send: Send) -> None:
        await asyncio.sleep(30)

    settings = Settings(timeout=0.2)
    begun, *parts = said(drip, settings)
    assert begun["status"] == 200
    assert b"".join(part["body"] for part in parts) == b"0123"
    assert said(wait, settings)[0]["status"] == 503
