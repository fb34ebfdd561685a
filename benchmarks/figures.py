"""The figures of a benchmark at rest: `benchmarks/results/NAME.json`, every run and what made it.

A record says how it came about (`source`), by which command, at which commit, of which solver and version, on which
processor and when; `runs` holds every run with its seed, also those that failed or did not converge, and `table` the
rows that were printed of them. `source` is "run" where the benchmark itself wrote the record, and "text" where the rows
were taken over from a document that had been written by hand: no record of those runs was kept, which the document
says.
"""

from __future__ import annotations

import datetime
import json
import os
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

__all__ = ["RESULTS", "ROOT", "Sheet", "keep", "load", "machine", "markdown", "names", "short"]

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"

Row = dict[str, Any]


def keep(name: str, runs: Sequence[Mapping[str, Any]], solver: str | None = None, **more: Any) -> Path:
    """Write the record of a benchmark that has just run in this process, and return its path.

    `solver` names the solver whose version the figures hang on; None for those of the service and the store. `more`
    goes into the record as it is (`table`, say).
    """
    record = {"name": name, "source": "run", **made(solver), "runs": list(runs), **more}
    path = RESULTS / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(".part")
    fresh.write_text(json.dumps(_rounded(record), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    fresh.replace(path)
    print(f"kept in {path.relative_to(ROOT)}; `make docs` renders it", file=sys.stderr)
    return path


def made(solver: str | None) -> Row:
    """Return what stands at the head of a record: command, commit, solver and version, processor, day."""
    from solver import registry

    spec = getattr(sys.modules["__main__"], "__spec__", None)
    called = f"python -m {spec.name.removesuffix('.__main__')}" if spec else Path(sys.argv[0]).name
    version = {"solver": solver, "version": registry.get(solver).version} if solver else {}
    return {
        "command": shlex.join([*called.split(), *map(_relative, sys.argv[1:])]),
        "commit": _commit(),
        **version,
        "machine": machine(),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }


def machine() -> Row:
    """Return processor, cores and Python of this machine, and how many processes have wanted to run of late."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists() and (found := re.search(r"model name\s*:\s*(.+)", info.read_text())):
        cpu = found[1]
    load = os.getloadavg()[1] if hasattr(os, "getloadavg") else None
    return {"cpu": cpu, "cores": os.cpu_count(), "python": platform.python_version(), "load": load}


def load(name: str) -> Row:
    """Read the record of that name."""
    record: Row = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return record


def names() -> list[str]:
    """Return the names of all records."""
    return sorted(path.stem for path in RESULTS.glob("*.json"))


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(row) + " |" for row in rows)]
    return "\n".join(re.sub(r"  +", " ", line) for line in lines)


def short(value: float) -> str:
    """Return a number by its first two digits, without a power of ten."""
    return f"{float(f'{value:.2g}'):g}" if value < 1e5 else f"{float(f'{value:.2g}'):.0f}"


class Sheet:
    """A table that is printed row by row while the runs go on, and kept with them at the end."""

    def __init__(self, name: str, head: Sequence[str], solver: str | None = None) -> None:
        self.name, self.head, self.solver = name, list(head), solver
        self.runs: list[Row] = []
        self.rows: list[list[str]] = []
        print(markdown(self.head, []))

    def add(self, cells: Sequence[object], /, **run: Any) -> None:
        """Print a row; `run` is what was measured, unrounded, for the record (without: the cells)."""
        row = [str(cell) for cell in cells]
        self.rows.append(row)
        self.runs.append(run or dict(zip(self.head, row, strict=True)))
        print(markdown(self.head, [row]).splitlines()[-1], flush=True)

    def keep(self, **more: Any) -> Path:
        """Write the record."""
        return keep(self.name, self.runs, self.solver, table={"head": self.head, "rows": self.rows}, **more)


def _commit() -> str:
    """Return the commit, with a plus sign where files differ from it; empty outside of a checkout."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
        return done.stdout.strip()

    commit = git("rev-parse", "--short=10", "HEAD")
    return commit + "+" * bool(git("status", "--porcelain", "--untracked-files=no", "--", "*.py", "*.toml"))


def _relative(word: str) -> str:
    """Return a word of a command without the place where this machine keeps what it names."""
    path = Path(word)
    return path.name if path.is_absolute() else word


def _rounded(value: Any) -> Any:
    """Six digits are more than any of these figures has."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, Mapping):
        return {name: _rounded(item) for name, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list | tuple) else value
