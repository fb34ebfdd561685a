"""Many small runs at once: python -m benchmarks.dehydration.precision.many [--turns 2].

A plan of twelve eighths at preview, swept into an empty store by one process, which may use all cores, and by as many
processes as there are cores, which share them; in turns, compiled before. Samples an hour, and how many cores were
busy.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.figures import ROOT, Sheet

PLAN = """
solver = "dehydration"
name = "many"
preset = "sphere"

[set]
mirrors = "xyz"

[axes]
te = [0.04, 0.035, 0.03]
gamma = [10, 20, 30, 50]

[need]
stages = [0.1, 0.15, 0.2, 0.3]
quality = "preview"
resolution = 64
"""
_RUNS = 12


def _swept(workers: int) -> tuple[float, float]:
    """Return the seconds and the processor seconds of a sweep of the plan."""
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "many.toml"
        plan.write_text(PLAN)
        command = [sys.executable, "-m", "service.cli", "sweep", str(plan), "--store", f"{folder}/store", "--json"]
        spent, begin = _spent(), time.perf_counter()
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        subprocess.run([*command, "--workers", str(workers)], check=True, stdout=subprocess.DEVNULL, env=environment)
        return time.perf_counter() - begin, _spent() - spent


def _spent() -> float:
    of = resource.getrusage(resource.RUSAGE_CHILDREN)
    return of.ru_utime + of.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=2)
    turns = parser.parse_args().turns
    sheet = Sheet(
        "dehydration-many",
        ["processes", "turn", "seconds", "processor", "cores busy", "samples an hour"],
        "dehydration",
    )
    cores = os.cpu_count() or 1
    for turn in range(turns):
        for workers in (1, cores):
            wall, cpu = _swept(workers)
            rate = 3600 * _RUNS / wall
            sheet.add(
                [workers, turn, f"{wall:.1f}", f"{cpu:.1f} s", f"{cpu / wall:.2f}", f"{rate:.0f}"],
                workers=workers, turn=turn, wall=wall, cpu=cpu, samples_hour=rate,
            )  # fmt: skip
    sheet.keep(runs_each=_RUNS, cores=cores)


if __name__ == "__main__":
    main()
