"""Addresses as the asker has to write them: below the path where a proxy serves us."""

from __future__ import annotations

from contextvars import ContextVar

from starlette.types import ASGIApp, Receive, Scope, Send

__all__ = ["Rooted", "link"]

_root: ContextVar[str] = ContextVar("wizen_root", default="")


def link(path: str) -> str:
    """Return an address of ours as the request under way has to be answered with it."""
    return _root.get() + path


class Rooted:
    """Lets the application live below a path, whether a proxy strips that on the way in or not."""

    def __init__(self, app: ASGIApp, root: str) -> None:
        self.app = app
        self.root = root

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on as if there were nothing above us, but for the links in its answer."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        path = scope["path"]
        if path == self.root or path.startswith(f"{self.root}/"):
            scope = {**scope, "path": path[len(self.root) :] or "/"}
        token = _root.set(self.root)
        try:
            await self.app(scope, receive, send)
        finally:
            _root.reset(token)
