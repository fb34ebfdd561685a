"""The parts of one benchmark, kept after every run; and runs in processes of their own.

A run of its own process has its own peak memory and its own CPU time, and can be stopped after its time limit: one call
is python -m benchmarks.dehydration.precision.record MODULE:FUNCTION JSON.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import figures
from benchmarks.figures import ROOT

#: One thread each, so that CPU seconds of different codes compare.
SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")

Row = dict[str, Any]


class Record:
    """The parts of `benchmarks.dehydration`, each a record of its own: rows that are found again by their key.

    Without `kept`, nothing is read and nothing written.
    """

    def __init__(self, kept: bool = True) -> None:
        self.kept = kept
        self.parts: dict[str, list[Row]] = {}

    def rows(self, part: str) -> list[Row]:
        """Return the rows of a part."""
        if part not in self.parts:
            there = self.kept and f"dehydration-{part}" in figures.names()
            self.parts[part] = figures.load(f"dehydration-{part}")["runs"] if there else []
        return self.parts[part]

    def row(self, part: str, key: Mapping[str, Any], run: Callable[[], Row], *, again: bool = False) -> Row:
        """Return the row with this key, from the file or by running it; `again` runs it whatever the file says."""
        rows = self.rows(part)
        old = [row for row in rows if all(row.get(name) == value for name, value in key.items())]
        if old and not again:
            return old[0]
        rows[:] = [row for row in rows if row not in old]
        row = {**key, **run(), "commit": figures.made(None)["commit"]}
        rows.append(row)
        self.save(part)
        return row

    def save(self, part: str, **more: Any) -> None:
        """Write the record of a part."""
        if self.kept:
            figures.keep(f"dehydration-{part}", self.rows(part), "dehydration", threads=1, **more)


def child(
    command: Sequence[str], *, limit: float, cwd: Path = ROOT, env: Mapping[str, str] | None = None
) -> tuple[str, float, str]:
    """Run a command on one thread; return its output, its CPU seconds and, where it failed, why."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    surroundings = {**os.environ, **SINGLE, **(env or {})}
    reason = ""
    try:
        done = subprocess.run(command, cwd=cwd, env=surroundings, capture_output=True, text=True, timeout=limit)
        output = done.stdout
        if done.returncode:
            last = (done.stderr.strip() or output.strip()).splitlines()[-1:]
            reason = f"ended with code {done.returncode}: {''.join(last)[:200]}"
    except subprocess.TimeoutExpired:
        output, reason = "", f"no answer within {limit:g} s"
    except OSError as error:
        output, reason = "", f"did not start: {error.strerror}"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return output, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, reason


def answer(command: Sequence[str], *, limit: float, env: Mapping[str, str] | None = None) -> Row:
    """Return the JSON object a command prints, and its process's CPU seconds; or why there is none."""
    output, cpu, reason = child(command, limit=limit, env=env)
    lines = [line for line in output.splitlines() if line.startswith("{")]
    if reason or not lines:
        return {"failed": reason or "no figures", "cpu_process": cpu}
    row: Row = json.loads(lines[-1])
    return {**row, "cpu_process": cpu}


def worker(function: str, **arguments: Any) -> Row:
    """Call `benchmarks.dehydration.precision.<module>:<function>` in a process of its own."""
    limit = float(arguments.pop("limit", 3600.0))
    command = [sys.executable, "-m", __name__, function, json.dumps(arguments)]
    return answer(command, limit=limit)


def _called(module: str, function: str, arguments: str) -> None:
    """Call a function of this folder and print what it returns, with the most memory that this process had [MB]."""
    found = importlib.import_module(f"benchmarks.dehydration.precision.{module}")
    row: Row = getattr(found, function)(**json.loads(arguments))
    row["peak_MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(row))


if __name__ == "__main__":
    _called(*sys.argv[1].split(":"), sys.argv[2])
