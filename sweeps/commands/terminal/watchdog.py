"""Nothing outlives a Ctrl-C or SIGTERM for long, whatever it is in the middle of: a factorisation, a compiled loop.

Commands stop by themselves where they can: solvers look up, jobs are given back. Where one sits in a long call, the
handler of a signal does not even run before that returns. A thread is told of the signal by the system itself, and
ends the process after a moment. That is safe at any time: files appear whole, by a rename, the ledger's transactions
are all or nothing, and worker processes end with their parent.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time

__all__ = ["end_soon", "guard", "leave"]

#: Seconds that a command gets to stop by itself; two seconds after the signal it has ended.
_PATIENCE = 0.9
_ENDING = frozenset({signal.SIGINT, signal.SIGTERM})
_heard = threading.Event()


def guard() -> None:
    """Watch for signals from now on; for programs, not for libraries: this takes the process's wakeup descriptor."""
    _open_streams()
    heard, told = os.pipe()
    os.set_blocking(told, False)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(heard,), name="wizen-watchdog", daemon=True).start()


def _open_streams() -> None:
    """Open what a program was begun without (`2>&-`): what it opens next would be in that place, and be written to."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            if handle == number:
                os.set_inheritable(handle, True)
            setattr(sys, name, os.fdopen(handle, "w" if number else "r"))


def end_soon() -> None:
    """End this process in a moment, if it has not ended by itself until then."""
    threading.Thread(target=_end, name="wizen-end", daemon=True).start()


def leave() -> None:
    """At the end of a program that was told to stop: end it now, without taking the interpreter apart piece by piece.

    No thread runs while that goes on, so that the watchdog could not end it.
    """
    if _heard.is_set():
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        code = getattr(sys.exception(), "code", 1)
        os._exit(code if isinstance(code, int) else 1)


def _watch(heard: int) -> None:
    while not _ENDING & set(os.read(heard, 16)):
        pass
    _heard.set()
    _end()


def _end() -> None:
    time.sleep(_PATIENCE)
    if sys.stderr.isatty():
        os.write(2, b"\x1b[?25h\n")  # a progress bar had hidden the cursor
    os.write(2, b"stopped.\n")
    os._exit(130)
