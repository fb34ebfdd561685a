"""The service ends within two seconds of a signal: jobs are told at once, and nothing is waited for in vain."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from sweeps.commands.terminal import watchdog

__all__ = ["PATIENCE", "at_signals"]

#: Seconds that answers under way get; streams of events would go on for ever.
PATIENCE = 0.7


@contextmanager
def at_signals(halt: Callable[[], None]) -> Iterator[None]:
    """Call `halt` when the server is told to stop: its own handler leaves that for when all answers are out."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def on(number: int, frame: FrameType | None) -> None:
        halt()
        server = before[signal.Signals(number)]
        if callable(server):
            watchdog.end_soon()
            server(number, frame)

    for number, handler in before.items():
        if callable(handler):
            signal.signal(number, on)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
