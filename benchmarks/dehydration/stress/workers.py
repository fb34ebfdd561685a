"""Worker processes that run the stress matrix, and are killed where they do not answer."""

from __future__ import annotations

import multiprocessing
import queue
import threading
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .judged import Case, Row

__all__ = ["run"]

WORKERS = 2
#: Seconds by the clock beyond a case's own limit (which counts processor time) after which its process is killed:
#: start, compilation and other work on the machine are not the run's.
GRACE = 600.0


def _work(pipe: Connection) -> None:
    from .judged import judge

    while (case := pipe.recv()) is not None:
        pipe.send(judge(case))


class _Worker:
    """A process that runs cases one by one; it is killed where it does not answer, and another one takes over."""

    def __init__(self) -> None:
        self._process: Any = None

    def run(self, case: Case) -> Row:
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_work, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()
        begun = time.monotonic()
        try:
            self._pipe.send(case)
            if self._pipe.poll(case.limit + GRACE):
                found: Row = self._pipe.recv()
                return found
            outcome, detail = "hang", f"no answer after {case.limit + GRACE:g} s"
        except (EOFError, OSError):
            self._process.join()
            outcome, detail = "crash", f"the process ended with code {self._process.exitcode}"
        self._process.kill()
        self._process = None
        return _lost(case, outcome, detail, time.monotonic() - begun)

    def end(self) -> None:
        if self._process is not None:
            self._pipe.send(None)
            self._process.join()


def _lost(case: Case, outcome: str, detail: str, seconds: float) -> Row:
    from .judged import Row

    return Row(case.group, case.what, case.n, outcome, detail, seconds=seconds)


def run(cases: Sequence[Case]) -> list[Row]:
    """Return what each case ended in, in their order."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
    for i in range(len(cases)):
        waiting.put(i)
    rows: dict[int, Row] = {}
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("stress", total=len(cases))

        def serve() -> None:
            worker = _Worker()
            while True:
                try:
                    i = waiting.get_nowait()
                except queue.Empty:
                    return worker.end()
                rows[i] = row = worker.run(cases[i])
                broken = sum(not row.good for row in rows.copy().values())
                if not row.good or not progress.console.is_terminal:
                    line = f"{len(rows):4d}  {row.group}: {row.what}: {row.outcome} {row.seconds:.1f} s"
                    progress.console.print(line, markup=False, highlight=False)
                progress.update(task, advance=1, description=f"stress, {broken} violations")

        threads = [threading.Thread(target=serve) for _ in range(WORKERS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return [rows[i] for i in range(len(cases))]
