"""Seeded schedules of claims, lease ends, suspensions, clock steps, crashes and cancels against the real ledger.

    python -m benchmarks.service.schedules [--count 100000] [--first 2000]

Plays them with a virtual clock (tests/sweeps/_simulation.py holds the invariants) and records how many broke one, what
one costs, and after how many each old defect is found that is put back. The record is kept after each tenth.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.figures import keep
from tests.sweeps._simulation import Broken, Unfenced, World

#: Old defects: how each is put back.
DEFECTS: dict[str, dict[str, Any]] = {
    "claims that are not fenced": {"ledger": Unfenced},
    "workers of one name": {"shared_names": True},
    "leases by the date": {"dated": True},
}


def broken(seeds: range, root: Path, **defect: Any) -> list[int]:
    """Return the seeds whose schedules break an invariant; with a defect, the first one alone."""
    found = []
    for seed in seeds:
        try:
            World(seed, root, **defect).run()
        except Broken:
            found.append(seed)
            if defect:
                break
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100_000, help="schedules")
    parser.add_argument("--first", type=int, default=2000, help="seed of the first one")
    options = parser.parse_args()
    head, rows, runs = ["ledger and runner", "schedules", "broken", "processor time of each"], [], []
    with tempfile.TemporaryDirectory() as folder:
        for name, defect in DEFECTS.items():
            seeds = broken(range(1000), Path(folder), **defect)
            played = seeds[0] + 1 if seeds else 1000
            runs.append({"defect": name, "schedules": played, "broken": seeds})
            rows.append([f"with {name}", f"{played} until one broke" if seeds else "1000", str(len(seeds)), ""])
        part, spent, bad = max(options.count // 10, 1), 0.0, list[int]()
        for done in range(0, options.count, part):
            begin = time.process_time()
            first = options.first + done
            many = min(part, options.count - done)
            bad += broken(range(first, first + many), Path(folder))
            spent += time.process_time() - begin
            played = done + many
            row = ["as they are", str(played), str(len(bad)), f"{1e3 * spent / played:.1f} ms"]
            run = {"defect": None, "first": options.first, "schedules": played, "broken": bad, "seconds": spent}
            keep("runner-schedules", [run, *runs], table={"head": head, "rows": [row, *rows]})
            print(row, flush=True)


if __name__ == "__main__":
    main()
