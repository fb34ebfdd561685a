"""The process of one live engine: messages come in on its standard input, replies and frames go out on its output.

Every packet is its length (u32, little-endian), one letter and its content: `M` a client's message, `C` a word of the
service's own (JSON both); back come `T` texts and `B` frames for the client, `S` processor seconds spent, `O` once it
runs, or `F`, an error, where it cannot begin, and `A` the session as a parameter file. It ends when its input does.
"""

from __future__ import annotations

import json
import queue
import struct
import sys
import threading
import time
from typing import Any, BinaryIO

__all__ = ["main", "packet"]

#: Seconds between two looks at the clock where work waits for its time, and between two words on what was spent.
_TICK, _SPENT = 0.004, 0.25
#: Messages that may wait: who sends more is made to wait as well, and fills no memory.
_MOST = 64


def packet(letter: bytes, content: bytes) -> bytes:
    """Return a packet."""
    return struct.pack("<Ic", len(content), letter) + content


def _read(stream: BinaryIO, into: queue.Queue[tuple[bytes, Any] | None]) -> None:
    while len(head := stream.read(5)) == 5:
        length, letter = struct.unpack("<Ic", head)
        into.put((letter, json.loads(stream.read(length))))
    into.put(None)


class _Out:
    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def __call__(self, letter: bytes, content: bytes) -> None:
        self._stream.write(packet(letter, content))
        self._stream.flush()

    def json(self, letter: bytes, content: Any) -> None:
        self(letter, json.dumps(content).encode())


def main() -> None:
    """Begin as the first message says, then work until the input ends."""
    # what numerical code prints must not come between packets
    out, sys.stdout = _Out(sys.stdout.buffer), sys.stderr
    came: queue.Queue[tuple[bytes, Any] | None] = queue.Queue(_MOST)
    threading.Thread(target=_read, args=(sys.stdin.buffer, came), daemon=True).start()
    first = came.get()
    if first is None:
        return
    from threadpoolctl import threadpool_limits

    from solver import registry
    from solver.contract import SolverError

    from .desk import Desk
    from .words import problem

    asked = first[1]
    solver = registry.get(asked["solver"])
    try:
        with threadpool_limits(1, user_api="blas"):
            desk = Desk(
                solver,
                solver.parse(asked["params"], asked["preset"]),
                asked["quality"],
                tuple(asked["fields"]),
                lambda told: out.json(b"T", told),
                lambda frame: out(b"B", frame),
            )
            out.json(b"O", {})
            _serve(desk, came, out)
    except SolverError as error:
        out.json(b"F", problem(error))
    except BrokenPipeError:
        pass


def _serve(desk: Any, came: queue.Queue[tuple[bytes, Any] | None], out: _Out) -> None:
    """Take what comes, work in between."""
    said = -_SPENT
    while True:
        while True:
            try:
                wait = 0.0 if desk.is_busy else _TICK if desk.is_waiting else None
                found = came.get(wait is None or wait > 0, wait)
            except queue.Empty:
                break
            if found is None:
                return
            _take(desk, found, out)
        desk.work()
        if time.process_time() - said >= _SPENT:
            said = time.process_time()
            out.json(b"S", said)


def _take(desk: Any, found: tuple[bytes, Any], out: _Out) -> None:
    letter, message = found
    if letter == b"M":
        desk.take(message)
    elif message == "hold":
        desk.held = True
    elif message == "save":
        out.json(b"A", desk.saved())
    else:
        desk.begin_again(message)


if __name__ == "__main__":
    main()
