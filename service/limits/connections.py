"""Limits on connections: how many, from whom, and how long and how large the head of a request may be.

uvicorn's parser takes heads of any length at any pace. Nobody who is honest sends a head of 32 kB, or needs ten seconds
for it; whoever does either is told so and let go, so that slow and silent connections cannot use up the service. Where
all connections are taken, a newcomer displaces the one that has been longest about its head. What becomes of crowds of
such connections is said in `waiting`.
"""

from __future__ import annotations

import asyncio
import itertools
import resource
import socket
from collections import Counter
from functools import cache
from typing import Any
from weakref import WeakKeyDictionary

import orjson
from uvicorn._types import ASGI3Application
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol, RequestResponseCycle
from uvicorn.server import ServerState

from ..problems import MEDIA_TYPE, URN
from ..settings import Settings
from . import waited
from .clients import address
from .door import DOOR
from .waiting import Waiting

__all__ = ["GuardedProtocol", "forget", "taken"]

#: Connections of each server by client.
_clients: WeakKeyDictionary[ServerState, Counter[str]] = WeakKeyDictionary()
#: Those of each server whose head has not come yet.
_waiting: WeakKeyDictionary[ServerState, Waiting] = WeakKeyDictionary()
#: Files that the process has open beside its connections: tables, the ledger, pipes.
_OTHER_FILES = 256
#: Seconds for which a connection that is one too many may stay without a word.
_LINGER = 0.5
#: Counts the connections that this process has taken.
_count = itertools.count(1)
_taken = 0


@cache
def _most(wanted: int) -> int:
    """Return how many connections there may be, with the limit on open files raised as far as that takes.

    Beyond it the system refuses connections by itself, and again and again, without a word to anybody.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = wanted + _OTHER_FILES
    if soft != resource.RLIM_INFINITY and soft < needed:
        soft = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        return max(min(wanted, soft - _OTHER_FILES), 1)
    return wanted


def taken() -> int:
    """Return how many connections this process has taken so far."""
    return _taken


def forget(server: ServerState, client: str) -> None:
    """Count one connection less of a client: it is lost, as HTTP or as what it became since (`sockets`)."""
    counts = _clients[server]
    counts[client] -= 1
    if counts[client] <= 0:
        del counts[client]


@cache
def _settings() -> Settings:
    # uvicorn makes the protocols, of a class: there is nobody to hand them settings but the environment
    return Settings()


class GuardedProtocol(HttpToolsProtocol):
    """HTTP/1.1 with limits; a request that is over them never reaches the application."""

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(*values, **named)
        self._limits = _settings()
        self._name = ""
        self._head = 0
        self._in_head = True
        self._refused = False
        self._full = ""
        self._waiting: Waiting
        #: Ends the wait for a word of one that is one too many.
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, if there is room for one more."""
        global _taken
        _taken = next(_count)
        super().connection_made(transport)
        limits = self._limits
        counts = _clients.setdefault(self.server_state, Counter())
        waiting = _waiting.get(self.server_state)
        if waiting is None:
            waiting = _waiting[self.server_state] = Waiting(self.loop, limits.head_timeout)
        self._waiting = waiting
        self._name = address(self.client[0]) if self.client else ""
        counts[self._name] += 1
        most = _most(limits.max_connections)
        if self._name and counts[self._name] > limits.max_connections_per_client:
            why = f"{limits.max_connections_per_client} connections of this client are open already."
            self._one_too_many(why, len(self.connections) <= most)
        elif len(self.connections) > most and not self._displace():
            self._one_too_many(f"{most} connections are open already.", False)
        else:
            waiting.add(self)

    def _one_too_many(self, why: str, has_room: bool) -> None:
        """Say why when something has come: what is closed unread resets the connection, and the answer is lost."""
        self._full = why
        if has_room and self._waiting.crowded:
            self._waiting.hold(self)
        else:
            self._timer = self.loop.call_later(_LINGER, self.late)

    def _displace(self) -> bool:
        """Let the connection go that has been longest about its head; return whether there was one."""
        slowest = self._waiting.first
        if not isinstance(slowest, GuardedProtocol):
            return False
        slowest._refuse(503, "too-many-connections", "others came with whole requests.")
        return True

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget a connection."""
        self._no_longer_wait()
        forget(self.server_state, self._name)
        if self.cycle is not None:
            waited.end(self.cycle.scope)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Parse what has come, unless the head is too long by now."""
        if self._refused:
            return
        if self._full:
            self._refuse(503, "too-many-connections", self._full)
            return
        if self._in_head:
            self._head += len(data)
        super().data_received(data)
        # a header that never ends stays inside the parser, which says nothing of it
        if self._in_head and self._head > self._limits.max_head:
            self._too_long()

    def on_message_begin(self) -> None:
        """Begin a request, perhaps not the first of this connection."""
        super().on_message_begin()
        if not self._in_head:  # the first one of a connection is waited for since it was made
            self._in_head = True
            self._waiting.add(self)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header."""
        super().on_header(name, value)
        if len(self.headers) > self._limits.max_headers:
            most = self._limits.max_headers
            self._refuse(431, "too-many-headers", f"the request has more than {most} headers.")

    def on_headers_complete(self) -> None:
        """Hand the request to the application."""
        self._in_head, self._head = False, 0
        self._no_longer_wait()
        if not self._refused and sum(len(n) + len(v) + 4 for n, v in self.headers) > self._limits.max_head:
            self._too_long()  # it came in one piece
        if not self._refused:
            super().on_headers_complete()

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
        """Answer what is turned away at the door; a uvicorn without this step leaves that to the application."""
        door = self.app_state.get(DOOR)
        response = None if door is None or self.flow.write_paused else door.refused(cycle.scope)
        if response is None:
            super()._start_asgi_task(cycle, app)
            return
        head = b"".join(b"%b: %b\r\n" % pair for pair in (*self.server_state.default_headers, *response.raw_headers))
        body = b"" if cycle.scope["method"] == "HEAD" else response.body
        close = b"" if cycle.keep_alive else b"connection: close\r\n"
        self.transport.write(b"".join([STATUS_LINE[response.status_code], head, close, b"\r\n", body]))
        cycle.response_started = cycle.response_complete = True  # a body, should there be one, is read and let go
        if not cycle.keep_alive:
            self.transport.close()
        self.on_response_complete()

    def on_body(self, body: bytes) -> None:
        """Take a piece of the body."""
        if not self._refused:
            super().on_body(body)

    def on_message_complete(self) -> None:
        """End a request."""
        if not self._refused:
            super().on_message_complete()

    def _no_longer_wait(self) -> None:
        self._waiting.drop(self)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def late(self) -> None:
        """Say that the time for a head is over, and close."""
        self._no_longer_wait()
        if self._head or self.headers:
            self._refuse(408, "request-timeout", f"no whole request came within {self._limits.head_timeout:g} s.")
        else:
            self.transport.close()  # nothing was said: there is nothing to answer

    def hold(self) -> socket.socket | None:
        """Read no more."""
        if self.transport.is_closing():
            return None
        self.flow.pause_reading()
        found: socket.socket | None = self.transport.get_extra_info("socket")
        return found

    def leave(self) -> None:
        """Close without a word."""
        self.transport.abort()

    def _too_long(self) -> None:
        self._refuse(431, "head-too-long", f"the head of the request is longer than {self._limits.max_head} bytes.")

    def _refuse(self, status: int, code: str, detail: str) -> None:
        """Send a problem and close."""
        if self._refused or self.transport.is_closing():
            return
        self._refused = True
        self._no_longer_wait()
        title = code.replace("-", " ").capitalize()
        body = orjson.dumps({"type": URN + code, "title": title, "status": status, "detail": detail})
        head = [
            STATUS_LINE[status],
            f"content-type: {MEDIA_TYPE}\r\ncontent-length: {len(body)}\r\n".encode(),
            b"retry-after: 5\r\n" if status == 503 else b"",
            b"cache-control: no-store\r\nconnection: close\r\n\r\n",
        ]
        self.transport.write(b"".join([*head, body]))
        self.transport.close()
