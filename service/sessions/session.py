"""One session: the process of its engine, and the connection of its client where there is one."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import struct
import sys
import time
from typing import Any

import orjson
from starlette.websockets import WebSocket, WebSocketState

from solver import contract
from store.ledger.asks import Asker
from sweeps.live.worker import packet

from .. import errors, problems
from ..telemetry import LOGGER

__all__ = ["CLOSED", "Session"]

#: Seconds that a client may take to read what it was sent; an engine to begin, to be told that nobody looks, and to
#: save, which of a mesh of 100,000 vertices takes some.
_READING, _BEGINNING, _HOLDING, _SAVING = 10.0, 120.0, 2.0, 20.0
#: Added to a problem's status, to make the code that a connection is closed with.
CLOSED = 4000
#: One engine keeps to one thread: its numbers must not hang on how many there are.
_ONE = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_KINDS: dict[str, type[contract.SolverError]] = {
    kind.code: kind for kind in (contract.InvalidInput, contract.InvalidGeometry, contract.OverBudget)
}


class Session:
    """An engine of its own process, kept while its client comes and goes."""

    def __init__(self, id: str, asker: Asker, solver: str, process: asyncio.subprocess.Process) -> None:
        self.id, self.asker, self.solver, self._process = id, asker, solver, process
        self.key = secrets.token_urlsafe(24)
        self.limited = True
        #: Processor seconds so far, when a client was last heard and when the last one left [s, monotonic].
        self.spent, self.heard, self.left = 0.0, time.monotonic(), time.monotonic()
        self.has_died = False
        self._is_closing = False
        self._client: WebSocket | None = None
        self._pump: asyncio.Task[None] | None = None
        self._saved: asyncio.Future[dict[str, Any]] | None = None

    @classmethod
    async def begin(cls, id: str, asker: Asker, asked: dict[str, Any]) -> Session:
        """Start the process of an engine and wait until it runs.

        Raises:
            InvalidInput: it cannot begin with what was asked for.
            EngineDied: it ended, or took too long.

        """
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "sweeps.live.worker",
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, env={**os.environ, **_ONE}, limit=1 << 24,
        )  # fmt: skip
        session = cls(id, asker, str(asked["solver"]), process)
        try:
            async with asyncio.timeout(_BEGINNING):
                await session._send(b"M", asked)
                letter, content = await session._next()
        except (TimeoutError, OSError, asyncio.IncompleteReadError, asyncio.CancelledError) as error:
            await session.end()
            if isinstance(error, asyncio.CancelledError):
                raise
            raise errors.EngineDied("the engine did not begin.", advice="The service's log may say why.") from None
        if letter == b"F":
            await session.end()
            told = json.loads(content)
            raise _KINDS.get(told["type"].rpartition(":")[2], contract.InvalidInput)(
                told["detail"], advice=told["advice"]
            )
        session._pump = asyncio.create_task(session._pumping())
        return session

    def is_key(self, key: str) -> bool:
        """Whether this is what the client was told in secret."""
        return secrets.compare_digest(key.encode(), self.key.encode())

    @property
    def is_attached(self) -> bool:
        """Whether a client is connected."""
        return self._client is not None

    async def attach(self, client: WebSocket, limits: dict[str, Any]) -> None:
        """Speak with this client from now on; one that spoke before is sent away."""
        if self._client is not None:
            await self._close(self._client, 409, "the session was taken up by another connection.")
        self._client, self.heard = client, time.monotonic()
        await self._send(b"C", {"session": self.id, "key": self.key, "limits": limits})

    async def detach(self, client: WebSocket) -> None:
        """A client has gone, in peace or not: the engine rests until one comes back."""
        if self._client is client:
            self._client, self.left = None, time.monotonic()
            with contextlib.suppress(TimeoutError, OSError):
                async with asyncio.timeout(_HOLDING):  # an engine that is behind takes nothing in
                    await self._send(b"C", "hold")

    async def take(self, message: dict[str, Any]) -> None:
        """Hand a client's message on.

        Raises:
            EngineDied: there is no engine any more.

        """
        # looking at frames keeps nobody's session open
        if message.get("do") != "seen":
            self.heard = time.monotonic()
        try:
            await self._send(b"M", message)
        except OSError:
            raise errors.EngineDied("the engine ended of itself.", advice="Open a new session.") from None

    async def dismiss(self, status: int, why: str) -> None:
        """Send the client away with what was made: the one that is there once it is saved."""
        if self._client is None:
            return
        saved: dict[str, Any] = {}
        if not self.has_died:
            self._saved = asyncio.get_running_loop().create_future()
            with contextlib.suppress(TimeoutError, OSError):
                async with asyncio.timeout(_SAVING):
                    await self._send(b"C", "save")
                    saved = await self._saved
        # the engine works on until it is ended; a client takes the word that it is sent away with as the last one
        self._is_closing, client = True, self._client
        if client is None:
            return
        with contextlib.suppress(Exception):
            async with asyncio.timeout(_READING):
                await client.send_text(orjson.dumps({"say": "closing", "why": why, **saved}).decode())
        await self._close(client, status, why)

    async def end(self) -> None:
        """End the process, whatever it does."""
        if self._pump is not None and self._pump is not asyncio.current_task():
            self._pump.cancel()
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        await self._process.wait()

    async def _send(self, letter: bytes, content: Any) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(packet(letter, orjson.dumps(content)))
            await self._process.stdin.drain()
        except RuntimeError:  # so uvloop says it
            raise BrokenPipeError from None

    async def _next(self) -> tuple[bytes, bytes]:
        assert self._process.stdout is not None
        length, letter = struct.unpack("<Ic", await self._process.stdout.readexactly(5))
        return letter, await self._process.stdout.readexactly(length)

    async def _pumping(self) -> None:
        """Pass on what the engine says, until it ends."""
        with contextlib.suppress(asyncio.IncompleteReadError, OSError):
            while True:
                letter, content = await self._next()
                if letter == b"S":
                    self.spent = float(content)
                elif letter == b"A":
                    if self._saved is not None and not self._saved.done():
                        self._saved.set_result(json.loads(content))
                elif self._client is not None and not self._is_closing:
                    await self._pass_on(self._client, letter, content)
        self.has_died = True
        if self._saved is not None and not self._saved.done():
            self._saved.set_result({})  # nobody will
        LOGGER.warning("session %s: the engine ended with %s", self.id, await self._process.wait())

    async def _pass_on(self, client: WebSocket, letter: bytes, content: bytes) -> None:
        try:
            async with asyncio.timeout(_READING):
                if letter == b"B":
                    await client.send_bytes(content)
                else:
                    await client.send_text(_told(content).decode())
        except TimeoutError:
            # it holds up nobody but itself, and may come back
            await self.detach(client)
            await self._close(client, 408, f"nothing was read for {_READING:g} s.")
        except (RuntimeError, OSError):
            await self.detach(client)

    async def _close(self, client: WebSocket, status: int, why: str) -> None:
        if client.application_state is WebSocketState.CONNECTED:
            with contextlib.suppress(Exception):
                async with asyncio.timeout(1.0):
                    await client.close(CLOSED + status, why[:120])


def _told(content: bytes) -> bytes:
    """Return a text of the engine's, which knows no status, with that of its problem if it tells of one."""
    if not content.startswith(b'{"say": "error"'):
        return content
    said = json.loads(content)
    said["problem"]["status"] = problems.status_of(said["problem"]["type"].rpartition(":")[2])
    return json.dumps(said).encode()
