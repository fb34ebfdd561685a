"""Progress for people: bars on a terminal's stderr, else one plain line per finished job."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ...running.report import Event
from .console import note

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

__all__ = ["GIVEN_BACK", "one_run", "stopping", "sweep"]

#: What a command says that is stopped while it runs jobs of a store.
GIVEN_BACK = "stopping: running jobs are given back; the same command goes on from here"

#: Nobody wants a bar for what takes less [s].
_PATIENCE = 2.0


@contextmanager
def stopping(said: str = "stopping") -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C or SIGTERM sets, saying `said`; a second one ends the program at once."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def on(number: int, frame: object) -> None:
        stop.set()
        for each, handler in before.items():
            signal.signal(each, handler)
        note(said)

    for number in before:
        signal.signal(number, on)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def one_run(title: str) -> Iterator[Callable[[float, str], None]]:
    """Yield an observer of one solve; it shows a bar once the solve takes long."""
    if not sys.stderr.isatty():
        yield lambda fraction, message: None
        return
    bars, start = _bars(), time.monotonic()
    task = bars.add_task(title, total=1.0)

    def observe(fraction: float, message: str) -> None:
        if time.monotonic() - start > _PATIENCE:
            bars.start()
        bars.update(task, completed=fraction, description=f"{title} {message}".strip())

    try:
        yield observe
    finally:
        bars.stop()


@contextmanager
def sweep(name: str, axes: Mapping[str, Callable[[Mapping[str, Any]], str]]) -> Iterator[Callable[[Event], None]]:
    """Yield an observer of a sweep. `axes` name what tells one job from another, and read it from its parameters."""

    def label(event: Event) -> str:
        return " ".join(f"{axis}={read(event.params)}" for axis, read in axes.items()) or event.key[:12]

    def line(event: Event) -> None:
        text = _line(event, label(event))
        if text:
            note(text)

    if not sys.stderr.isatty():
        yield line
        return
    with _bars() as bars:
        whole = bars.add_task(name, total=None)
        running: dict[str, TaskID] = {}

        def observe(event: Event) -> None:
            bars.update(whole, completed=event.finished, total=event.total)
            if event.kind in ("started", "progress"):
                if event.key not in running:
                    running[event.key] = bars.add_task(f"  {label(event)}", total=1.0)
                bars.update(running[event.key], completed=event.fraction)
            elif event.key in running:
                bars.remove_task(running.pop(event.key))
            if event.kind in ("retry", "failed"):
                bars.console.print(_line(event, label(event)), markup=False, highlight=False)

        yield observe


def _line(event: Event, label: str) -> str:
    count = f"[{event.finished}/{event.total}] {label}"
    why = (event.error or {}).get("message", "")
    lines = {
        "done": f"{count}: solved in {event.seconds:.1f} s",
        "reused": f"{count}: was stored already",
        "retry": f"{count}: {why} Trying again.",
        "failed": f"{count}: given up: {why}",
        "lost": f"{count}: taken away",
    }
    return lines.get(event.kind, "")


def _bars() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    class Count(MofNCompleteColumn):
        """Jobs as 3/6; a single job as a percentage."""

        def render(self, task: Any) -> Any:
            return super().render(task) if (task.total or 0) > 1 else TaskProgressColumn().render(task)

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), Count(), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True)
