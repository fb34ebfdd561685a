"""Where the processor's time of a dehydration run goes: python -m benchmarks.dehydration.precision.speed [--only WORD].

gamma 10, four stages to s = 0.3, each on two threads and on one, for the gain of the second (thin skins on two only).
Parts are told apart by a profile: calls of the march's kernel, which holds forces, contact and masses, and what a
stage's lattice and descriptors take. Kept after each run; cases that the record of this version has are not run again.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from typing import Any

import numba

from benchmarks.figures import RESULTS, keep, load
from solver.contract import Context, Need
from solver.dehydration import SOLVER

NAME = "dehydration-speed"
STAGES = (0.1, 0.15, 0.2, 0.3)
#: Quality, te, mirrors and threads, the cheapest first.
CASES = (
    ("preview", 0.04, "xyz", 2),
    ("preview", 0.04, "xyz", 1),
    ("default", 0.04, "xyz", 2),
    ("default", 0.04, "xyz", 1),
    ("preview", 0.02, "xyz", 2),
    ("preview", 0.02, "xyz", 1),
    ("preview", 0.04, "", 2),
    ("preview", 0.04, "", 1),
    ("default", 0.02, "xyz", 2),
    ("default", 0.04, "", 2),
    ("preview", 0.01, "xyz", 2),
    ("default", 0.01, "xyz", 2),
)
KEYS = ("quality", "te", "mirrors", "threads")
#: Parts by file and function.
PARTS = {"march and settling steps": ("march.py", "advance"), "lattice and descriptors": ("run.py", "add")}


def _measured(quality: str, te: float, mirrors: str, threads: int) -> dict[str, Any]:
    numba.set_num_threads(threads)
    params = SOLVER.parse({"te": te, "gamma": 10.0, "mirrors": mirrors}, "sphere")
    need = Need(stages=STAGES, quality=quality, resolution=64)
    profile = cProfile.Profile()
    begin, cpu = time.perf_counter(), time.process_time()
    profile.enable()
    found = SOLVER.solve(params, need, Context())
    profile.disable()
    cpu = time.process_time() - cpu
    calls = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    parts = {
        name: sum(row[3] for (file, _, called), row in calls.items() if file.endswith(path) and called == function)
        for name, (path, function) in PARTS.items()
    }
    return {
        "quality": quality, "te": te, "mirrors": mirrors, "threads": threads, "cpu": cpu,
        "seconds": time.perf_counter() - begin,
        "steps": int(found["iterations"].values[-1]), "elements": int(found.attrs["elements"]),
        "converged": found["converged"].values.tolist(), "parts": parts,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help='cases whose "quality te mirrors threads" contains this')
    asked = parser.parse_args()
    SOLVER.solve(
        SOLVER.parse({"te": 0.1, "mirrors": "xyz"}, "sphere"), Need(stages=(0.1,), quality="preview"), Context()
    )
    known = load(NAME) if (RESULTS / f"{NAME}.json").exists() else {}
    rows = known["runs"] if known.get("version") == SOLVER.version else []
    for case in CASES:
        if asked.only in "{} {} {} {}".format(*case) and case not in [tuple(r[name] for name in KEYS) for r in rows]:
            rows.append(_measured(*case))
            print(rows[-1], flush=True)
            keep(NAME, rows, "dehydration")


if __name__ == "__main__":
    main()
