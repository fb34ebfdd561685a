"""The common question, one small shape, without the way through the router: that takes as long as the shape itself.

What cannot be answered at once goes the whole way, and so does every question with something wrong: there it is
explained.
"""

from __future__ import annotations

from typing import NamedTuple

from starlette.datastructures import State
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from solver.contract import SolverError
from store.errors import StoreError

from ..errors import ServiceError
from . import routes as shapes

__all__ = ["Shortcut"]

_PREFIX = "/v1/shapes/"


class _Route(NamedTuple):
    """The route's name in the log and the metrics."""

    path: str


_ROUTE = _Route(_PREFIX + "{solver}")


class Shortcut:
    """Answers for small shapes. Only where reading is free: whoever must show a token is asked for it."""

    def __init__(self, app: ASGIApp, state: State) -> None:
        self.app = app
        self.state = state

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass the request on."""
        if scope["type"] == "http" and scope["method"] == "GET" and scope["path"].startswith(_PREFIX):
            request = Request(scope)
            try:
                response = await shapes.at_once(request, scope["path"][len(_PREFIX) :])
            except (StoreError, ServiceError, SolverError, OSError):
                response = None  # the handler meets the same
            if response is not None:
                scope["route"] = _ROUTE
                await response(scope, receive, send)
                return
        await self.app(scope, receive, send)
