"""The compiled code that folded shapes need: whoever asks for the first of them waits for it, and nobody else does.

It is made once on a machine, which takes some 20 s of a processor, and kept beside the code; from then on it is loaded
in half a second. `wizen serve` has it made aside, by a process of low priority, as soon as it starts. Without that (or
before that has ended) it is made in the thread of the request that needs it: never in the event loop.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading

__all__ = ["Compiling", "NotAtOnce"]

#: What is run aside: it gives way to everybody, and ends with us however we do.
_ASIDE = """
import ctypes, os, signal, sys
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
if os.getppid() != {parent}:
    sys.exit()
os.nice(10)
from store.surfaces.apart import compiled
compiled()
"""


class NotAtOnce(Exception):
    """What is asked for takes too long for the event loop: a thread is to answer it."""


class Compiling:
    """Called before a folded shape is computed; in a thread, it returns once the compiled code is there."""

    def __init__(self) -> None:
        self._is_done = False
        self._aside: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    @property
    def is_under_way(self) -> bool:
        """Whether somebody waits for it."""
        return self._lock.locked()

    def begin(self) -> None:
        """Have it made aside, for this process or those that it starts; from the main thread."""
        code = _ASIDE.format(parent=os.getpid())
        no = subprocess.DEVNULL
        self._aside = subprocess.Popen([sys.executable, "-c", code], stdin=no, stdout=no, stderr=no)

    def end(self) -> None:
        """Leave off what is made aside."""
        if self._aside is not None:
            self._aside.kill()
            self._aside.wait()

    def __call__(self) -> None:
        """Wait until the code is there, making it if need be.

        Raises:
            NotAtOnce: this is the event loop.

        """
        if _is_event_loop():
            raise NotAtOnce
        if self._is_done:
            return
        with self._lock:
            if self._is_done:
                return
            if self._aside is not None:
                self._aside.wait()
            from store.surfaces.apart import compiled

            compiled()
            self._is_done = True


def _is_event_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True
