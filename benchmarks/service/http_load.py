"""Requests over several connections from one thread, cheap enough to leave the server its core."""

from __future__ import annotations

import selectors
import socket
import time
from collections.abc import Callable
from typing import NamedTuple

__all__ = ["Load", "drive"]


class Load(NamedTuple):
    """What came of it: latencies [s] sorted, wall time [s], mean body [bytes], answers that were not 200 or broke."""

    latencies: list[float]
    seconds: float
    body: float
    failed: int

    @property
    def rate(self) -> float:
        """Answers per second."""
        return len(self.latencies) / self.seconds

    def quantile(self, q: float) -> float:
        """Return a quantile of the latency [ms]."""
        return 1e3 * self.latencies[min(int(q * len(self.latencies)), len(self.latencies) - 1)]


class _Connection:
    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=20)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.begin = 0.0
        self._head = b""
        self._left: int | None = None
        self.status = 0
        self.length = 0

    def send(self, path: str) -> None:
        self._head, self._left, self.begin = b"", None, time.perf_counter()
        self.socket.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: */*\r\n\r\n".encode())

    def receive(self) -> bool:
        """Read what is there; return whether the answer is whole.

        Raises:
            ConnectionError: the server hung up.

        """
        data = self.socket.recv(1 << 18)
        if not data:
            raise ConnectionError
        if self._left is None:
            self._head += data
            end = self._head.find(b"\r\n\r\n")
            if end < 0:
                return False
            lines = self._head[:end].lower().split(b"\r\n")
            self.status = int(lines[0].split()[1])
            self.length = next(int(line[15:]) for line in lines if line.startswith(b"content-length:"))
            self._left = self.length - (len(self._head) - end - 4)
        else:
            self._left -= len(data)
        return self._left <= 0


def drive(
    port: int, path: Callable[[int], str], clients: int, seconds: float, between: Callable[[], bool] | None = None
) -> Load:
    """Ask for `path(0)`, `path(1)`, ... for so long on `clients` connections, each always waiting for one answer.

    `between` is called again and again meanwhile, and ends it by returning False.
    """
    latencies: list[float] = []
    bodies, failed, asked = 0, 0, 0
    selector = selectors.DefaultSelector()

    def connect() -> None:
        nonlocal asked
        connection = _Connection(port)
        selector.register(connection.socket, selectors.EVENT_READ, connection)
        connection.send(path(asked))
        asked += 1

    for _ in range(clients):
        connect()
    start = time.perf_counter()
    while time.perf_counter() - start < seconds and (between is None or between()):
        for key, _ in selector.select(0.01):
            connection: _Connection = key.data
            try:
                if not connection.receive():
                    continue
            except OSError:
                failed += 1
                selector.unregister(connection.socket)
                connect()
                continue
            latencies.append(time.perf_counter() - connection.begin)
            bodies += connection.length
            failed += connection.status != 200
            connection.send(path(asked))
            asked += 1
    elapsed = time.perf_counter() - start
    for key in list(selector.get_map().values()):
        key.data.socket.close()
    return Load(sorted(latencies), elapsed, bodies / max(len(latencies), 1), failed)
