"""Requests that do not wait for each other's answers: what overload is made of.

Everything runs in one event loop, on sockets of its own, cheap enough to leave the server its core.
"""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import uvloop

__all__ = ["Found", "closed_loop", "open_loop", "run"]

#: From how many addresses is asked: a crowd, no single client.
_ADDRESSES = 32


class Found(NamedTuple):
    """What came of it: latencies [s] of answers with 200 and with 503, sorted, and how many broke or said else.

    `late` is how much later than it was due each was asked [s], sorted: the asker's own lack of a processor.
    """

    good: list[float]
    refused: list[float]
    broken: int
    seconds: float
    late: list[float]

    @property
    def rate(self) -> float:
        """Good answers per second."""
        return len(self.good) / self.seconds


class _Line(asyncio.Protocol):
    """A connection that is kept, with one question at a time."""

    def __init__(self) -> None:
        self._answer: asyncio.Future[int] | None = None
        self._head, self._left, self._status = b"", -1, 0
        self.transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def connection_lost(self, exc: Exception | None) -> None:
        self.transport = None
        if self._answer is not None and not self._answer.done():
            self._answer.set_result(0)

    def data_received(self, data: bytes) -> None:
        if self._left < 0:
            self._head += data
            end = self._head.find(b"\r\n\r\n")
            if end < 0:
                return
            lines = self._head[:end].lower().split(b"\r\n")
            self._status = int(lines[0].split()[1])
            length = next((int(line[15:]) for line in lines if line.startswith(b"content-length:")), 0)
            self._left = length - (len(self._head) - end - 4)
        else:
            self._left -= len(data)
        if self._left <= 0 and self._answer is not None and not self._answer.done():
            self._answer.set_result(self._status)

    async def ask(self, path: str) -> int:
        """Return the status of the answer, 0 where the connection broke."""
        if self.transport is None:
            return 0
        self._answer = asyncio.get_running_loop().create_future()
        self._head, self._left = b"", -1
        self.transport.write(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: */*\r\n\r\n".encode())
        return await self._answer


class _Asker:
    """Asks over connections that nobody else is using, and counts."""

    def __init__(self, port: int, path: Callable[[int], str]) -> None:
        self.port, self.path, self.asked = port, path, 0
        self.idle: list[_Line] = []
        self.good: list[float] = []
        self.refused: list[float] = []
        self.broken = 0
        self.late: list[float] = []

    async def ask(self, due: float | None = None) -> None:
        self.asked += 1
        path, begin = self.path(self.asked), time.perf_counter()
        if due is not None:
            self.late.append(begin - due)
        while self.idle and self.idle[-1].transport is None:
            self.idle.pop()
        try:
            if self.idle:
                line = self.idle.pop()
            else:
                loop = asyncio.get_running_loop()
                source = f"127.2.0.{self.asked % _ADDRESSES + 1}", 0
                line = (await loop.create_connection(_Line, "127.0.0.1", self.port, local_addr=source))[1]
            status = await line.ask(path)
        except OSError:
            status = 0
        seconds = time.perf_counter() - begin
        if status in (200, 503):
            (self.good if status == 200 else self.refused).append(seconds)
            self.idle.append(line)
        else:
            self.broken += 1

    def found(self, seconds: float) -> Found:
        for line in self.idle:
            if line.transport is not None:
                line.transport.close()
        return Found(sorted(self.good), sorted(self.refused), self.broken, seconds, sorted(self.late))


async def closed_loop(port: int, path: Callable[[int], str], clients: int, seconds: float) -> Found:
    """Ask for `path(1)`, `path(2)`, ..., each client for the next one when it has its answer."""
    asker, begin = _Asker(port, path), time.perf_counter()

    async def client() -> None:
        while time.perf_counter() - begin < seconds:
            await asker.ask()

    await asyncio.gather(*(client() for _ in range(clients)))
    return asker.found(time.perf_counter() - begin)


async def open_loop(port: int, path: Callable[[int], str], rate: float, seconds: float, seed: int = 0) -> Found:
    """Ask at random moments, `rate` times a second in the mean, however long the answers take."""
    asker, chance = _Asker(port, path), random.Random(seed)
    begin = due = time.perf_counter()
    under_way: set[asyncio.Task[None]] = set()
    while (due := due + chance.expovariate(rate)) < begin + seconds:
        if (wait := due - time.perf_counter()) > 0:
            await asyncio.sleep(wait)
        task = asyncio.ensure_future(asker.ask(due))
        under_way.add(task)
        task.add_done_callback(under_way.discard)
    if under_way:
        await asyncio.wait(under_way, timeout=60)
    return asker.found(time.perf_counter() - begin)


def run(asking: object) -> Found:
    """Run one of the above to its end."""
    return uvloop.run(asking)  # type: ignore[arg-type, return-value]
