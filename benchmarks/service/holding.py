"""Slow connections, in a process of their own: python -m benchmarks.service.holding PORT COUNT

Each sends a head byte by byte, from one of many addresses, and comes back when it is let go. Prints a line once all are
there.
"""

from __future__ import annotations

import asyncio
import os
import random
import resource
import sys
from collections.abc import Callable
from typing import Any

import uvloop

__all__ = ["hold"]

#: The slow ones send a byte that often [s].
_DRIBBLE = 5.0
#: They come at that rate at first [1/s], and so many of them from one address.
_COMING, _PER_ADDRESS = 1000.0, 200


class _Slow(asyncio.Protocol):
    """Sends a head byte by byte, and starts anew when it is let go."""

    def __init__(self, made: Callable[[], None], lost: Callable[[], None]) -> None:
        self._made, self._lost = made, lost
        self._timer: Any = None
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport
        self._transport.write(b"GET / HTTP/1.1\r\nX-Slow: ")
        self._made()
        self._dribble()

    def _dribble(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(_DRIBBLE * random.uniform(0.5, 1.5), self._dribble)
        self._transport.write(b"a")

    def connection_lost(self, exc: Exception | None) -> None:
        self._timer.cancel()
        self._lost()


async def hold(port: int, count: int) -> None:
    """Hold so many slow connections until cancelled."""
    loop, chance = asyncio.get_running_loop(), random.Random(1)
    trying: set[asyncio.Task[None]] = set()
    there, said = 0, False

    def made() -> None:
        nonlocal there, said
        there += 1
        if there == count and not said:
            said = True
            print(f"{count} are there", flush=True)

    def begin(source: str, pause: float) -> None:
        task = loop.create_task(one(source, pause))
        trying.add(task)
        task.add_done_callback(trying.discard)

    async def one(source: str, pause: float) -> None:
        def again() -> None:
            nonlocal there
            there -= 1
            begin(source, chance.uniform(0.5, 1.5))

        await asyncio.sleep(pause)
        try:
            await loop.create_connection(lambda: _Slow(made, again), "127.0.0.1", port, local_addr=(source, 0))
        except OSError:
            begin(source, chance.uniform(0.5, 1.5))

    for i in range(count):
        address = i // _PER_ADDRESS
        begin(f"127.1.{address // 250}.{address % 250 + 1}", chance.uniform(0, count / _COMING))
    await asyncio.sleep(1e9)


def main() -> None:
    os.nice(19)  # whatever else there is to do comes first
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    port, count = (int(word) for word in sys.argv[1:3])
    uvloop.run(hold(port, count))


if __name__ == "__main__":
    main()
