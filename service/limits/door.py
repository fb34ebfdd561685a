"""Refusals before a request reaches the application: there is most of them when there is too much to do.

`Admission` decides the same behind everything that a request passes on its way in. That way costs a good part of a
small shape, and at twice the peak rate half of all requests go it for nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from starlette.responses import Response
from starlette.types import Scope

from store.tokens import Tokens

from ..settings import Settings
from .admission import Load, refusal
from .clients import client_of

__all__ = ["DOOR", "Door"]

#: Name of the door in the state that the application hands to its server.
DOOR = "wizen.door"


class Door:
    """Turns away what `load` has no time for, unless `is_kept(scope)`: an answer that lies ready costs less.

    `record` is told of each refusal: the scope, method, status, bytes and seconds.
    """

    def __init__(
        self,
        settings: Settings,
        load: Load,
        tokens: Tokens,
        is_kept: Callable[[Scope], bool],
        record: Callable[[Scope, str, int, int, float], None],
    ) -> None:
        self._settings, self._load, self._tokens = settings, load, tokens
        self._is_kept, self._record = is_kept, record

    def refused(self, scope: Scope) -> Response | None:
        """Return the answer to a request that is turned away, None for one that may go on to the application.

        Leaves to the application: what has a body, and everything where other sites' pages ask (their headers are not
        known here).
        """
        if scope["method"] not in ("GET", "HEAD") or self._settings.cors_origins:
            return None
        begin, root = time.perf_counter(), self._settings.root_path
        path = scope["path"]
        if root and path.startswith(f"{root}/"):
            scope = {**scope, "path": path[len(root) :]}
        forwarded = any(name == b"x-forwarded-for" for name, _ in scope["headers"])
        response = refusal(self._load, scope, None if forwarded else client_of(scope, self._tokens))
        if response is None or self._is_kept(scope):
            return None
        response.headers["X-Request-ID"] = scope["state"]["request_id"]
        seconds = time.perf_counter() - begin
        self._record(scope, scope["method"], response.status_code, len(response.body), seconds)
        return response
