"""A client of live sessions, written from docs/sessions.md alone: it shares no code with what it speaks to."""

from __future__ import annotations

import json
import struct
import time
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect


class Client:
    """One connection: `ask` waits for its reply, `until_rest` for the end of work; frames are taken in on the way."""

    def __init__(self, url: str, solver: str = "growth", acknowledges: bool = True, **opening: Any) -> None:
        where = f"{url.replace('http', 'ws', 1).rstrip('/')}/v1/sessions/{solver}"
        self._open = ExitStack()
        self.socket = self._open.enter_context(connect(where, max_size=None, compression=None))
        self.acknowledges = acknowledges
        self.number = 0
        self.x, self.triangles = np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32)
        self.frames: list[dict[str, Any]] = []
        self.told: list[dict[str, Any]] = []
        self.state: dict[str, Any] = {}
        self.last = 0
        if opening:
            self.send(do="open", **opening)

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def receive(self, timeout: float = 120.0) -> dict[str, Any] | None:
        """Take one message in; return it if it is a text."""
        came = self.socket.recv(timeout)
        if isinstance(came, bytes):
            self._take(came)
            return None
        said = json.loads(came)
        self.told.append(said)
        if said["say"] == "state":
            self.state = said
        return said

    def opened(self) -> dict[str, Any]:
        while True:
            said = self.receive()
            if said and said["say"] in ("opened", "error"):
                return said

    def ask(self, do: str, **values: Any) -> dict[str, Any]:
        self.number += 1
        self.send(do=do, id=self.number, **values)
        while True:
            said = self.receive()
            if said and said.get("id") == self.number and said["say"] in ("done", "saved", "error"):
                return said

    def until(self, what: Any, seconds: float = 300.0) -> None:
        end = time.monotonic() + seconds
        while not what(self):
            assert time.monotonic() < end, (self.state, self.frames[-1:])
            self.receive()

    def rest(self) -> None:
        """Wait until everything that was asked for is in a frame at rest."""
        self.until(lambda c: c.frames and not c.frames[-1]["flags"] & 2 and c.frames[-1]["input"] >= c.last_geometry)

    @property
    def last_geometry(self) -> int:
        return self.last

    def do(self, do: str, **values: Any) -> dict[str, Any]:
        """Ask for something that changes the geometry, and be content with nothing less."""
        said = self.ask(do, **values)
        assert said["say"] == "done", said
        self.last = self.number
        return said

    def close(self) -> None:
        self._open.close()

    def end(self) -> None:
        """End the session, and return once the service says that it has ended: there is room for another."""
        self.send(do="close")
        with suppress(ConnectionClosed):
            self.until(lambda c: False)
        self.close()

    def _take(self, data: bytes) -> None:
        magic, number, base, n, m, r, p, q, quantum, k, stage, residual, input_, ms, flags = struct.unpack_from(
            "<4s7IfIdfIfI", data
        )
        assert magic == b"wzn1"
        assert base == (self.frames[-1]["number"] if base else 0)
        at = 64

        def take(kind: str, count: int) -> np.ndarray:
            nonlocal at
            found = np.frombuffer(data, kind, count, at)
            at += -(-found.nbytes // 4) * 4
            return found

        def numbers(count: int, whole: int) -> np.ndarray:
            return take("<u4", count) if count < whole else np.arange(whole)

        x = np.zeros((n, 3), np.float32)
        triangles = np.zeros((m, 3), np.uint32)
        if base:
            x[: min(n, len(self.x))] = self.x[:n]
            triangles[: min(m, len(self.triangles))] = self.triangles[:m]
        rows = numbers(r, m)
        triangles[rows] = take("<u4", 3 * r).reshape(-1, 3)
        placed = numbers(p, n)
        x[placed] = take("<f4", 3 * p).reshape(-1, 3)
        moved = numbers(q, n)
        steps = take("<i2", 3 * q).reshape(-1, 3)
        x[moved] = (x[moved].astype(float) + float(quantum) * steps.astype(float)).astype(np.float32)
        fields = []
        for _ in range(k):
            low, high = take("<f4", 2)
            fields.append(float(low) + (float(high) - float(low)) * take("u1", n) / 255)
        assert at == len(data)
        assert m == 0 or triangles.max() < n
        self.x, self.triangles = x, triangles
        told = {"number": number, "base": base, "stage": stage, "residual": residual, "input": input_, "ms": ms}
        self.frames.append({**told, "flags": flags, "bytes": len(data), "fields": fields, "vertices": n})
        if self.acknowledges:
            # what came before the end is still to be read, though nothing can be answered any more
            with suppress(ConnectionClosed):
                self.send(do="seen", frame=number)
