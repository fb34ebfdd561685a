"""The process of one live engine: messages come in on its standard input, replies and frames go out on its output.

Every packet is its length (u32, little-endian), one letter and its content: `M` a client's message, `C` a word of the
service's own (JSON both); back come `T` texts and `B` frames for the client, `S` processor seconds spent, `O` once it
runs, or `F`, an error, where it cannot begin, and `A` the session as a parameter file. It ends when its input does.
"""

from __future__ import annotations

import contextlib
import json
import queue
import struct
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, BinaryIO

__all__ = ["main", "packet"]

#: Seconds between two looks at the clock where work waits for its time, and between two words on what was spent.
_TICK, _SPENT = 0.004, 0.25
#: Messages that may wait: who sends more is made to wait as well, and fills no memory.
_MOST = 64


def packet(letter: bytes, content: bytes) -> bytes:
    """Return a packet."""
    return struct.pack("<Ic", len(content), letter) + content


def _packet(stream: BinaryIO) -> tuple[bytes, Any] | None:
    """Return the next packet's letter and content; None where the input has ended."""
    if len(head := stream.read(5)) < 5:
        return None
    length, letter = struct.unpack("<Ic", head)
    return letter, json.loads(stream.read(length))


def _read(stream: BinaryIO, into: queue.Queue[tuple[bytes, Any] | None], save: Callable[[], None]) -> None:
    """Hand on what comes; what was made is saved at once: a piece of work may take longer than anybody waits for it."""
    while (found := _packet(stream)) is not None:
        if found == (b"C", "save"):
            save()
        else:
            into.put(found)
    into.put(None)


class _Out:
    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._lock = threading.Lock()

    def __call__(self, letter: bytes, content: bytes) -> None:
        with self._lock:
            self._stream.write(packet(letter, content))
            self._stream.flush()

    def json(self, letter: bytes, content: Any) -> None:
        self(letter, json.dumps(content).encode())


def main() -> None:
    """Begin as the first message says, then work until the input ends."""
    # what numerical code prints must not come between packets
    out, sys.stdout = _Out(sys.stdout.buffer), sys.stderr
    first = _packet(sys.stdin.buffer)
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
            _serve(desk, sys.stdin.buffer, out)
    except SolverError as error:
        out.json(b"F", problem(error))
    except BrokenPipeError:
        pass


def _serve(desk: Any, stream: BinaryIO, out: _Out) -> None:
    """Take what comes, work in between."""
    said = -_SPENT
    came: queue.Queue[tuple[bytes, Any] | None] = queue.Queue(_MOST)
    # between two messages the desk holds together, also while it works
    taking = threading.Lock()

    def save() -> None:
        with taking, contextlib.suppress(BrokenPipeError):
            out.json(b"A", desk.saved())

    threading.Thread(target=_read, args=(stream, came, save), daemon=True).start()
    while True:
        while True:
            try:
                wait = 0.0 if desk.is_busy else _TICK if desk.is_waiting else None
                found = came.get(wait is None or wait > 0, wait)
            except queue.Empty:
                break
            if found is None:
                return
            with taking:
                _take(desk, found)
        desk.work()
        if time.process_time() - said >= _SPENT:
            said = time.process_time()
            out.json(b"S", said)


def _take(desk: Any, found: tuple[bytes, Any]) -> None:
    letter, message = found
    if letter == b"M":
        desk.take(message)
    elif message == "hold":
        desk.held = True
    else:
        desk.begin_again(message)


if __name__ == "__main__":
    main()
