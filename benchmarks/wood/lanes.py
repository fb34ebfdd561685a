"""What lanes are worth, and what two runs at once cost: python -m benchmarks.wood.lanes.

A step of 200 rods by 30 vertices, CPU time, in processes of their own, in turns: as it is compiled, without the
vectorisation of loops (LLVM's loop and straight-line vectorisers off, so that each bond is computed alone), and two at
once, as `wizen sweep --workers 2` runs seeds.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

from benchmarks.figures import ROOT, Sheet

_TURNS = 3
_ALONE = {"NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
_WAYS = (("in lanes", {}, 1), ("bond by bond", _ALONE, 1), ("in lanes, two at once", {}, 2))


def timed() -> None:
    """Print what this process finds."""
    from .__main__ import per_step

    print(json.dumps(per_step(rods=200, bend=0.005)[2]))


def _asked(env: dict[str, str], number: int, cache: str) -> tuple[list[float], float]:
    """Return seconds of CPU per step of each of so many processes at once, and the wall time [s] of all."""
    words = [sys.executable, "-m", "benchmarks.wood.lanes", "--one"]
    # what is compiled otherwise is kept elsewhere
    own = {**os.environ, **env, **({"NUMBA_CACHE_DIR": cache} if env else {})}
    begun = time.perf_counter()
    running = [subprocess.Popen(words, cwd=ROOT, env=own, stdout=subprocess.PIPE, text=True) for _ in range(number)]
    found = [float(one.communicate()[0].strip().splitlines()[-1]) for one in running]
    return found, time.perf_counter() - begun


def main() -> None:
    """Print a row for every way."""
    head = ("a step of 200 rods", "CPU ms, turn by turn", "over lanes alone, median")
    sheet = Sheet("wood-lanes", head, "wood")
    found: dict[str, list[float]] = {name: [] for name, *_ in _WAYS}
    with tempfile.TemporaryDirectory() as cache:
        for env in ({}, _ALONE):
            _asked(env, 1, cache)  # compiles
        for _ in range(_TURNS):
            for name, env, number in _WAYS:
                found[name].append(float(np.mean(_asked(env, number, cache)[0])))
    base = np.array(found["in lanes"])
    for name, values in found.items():
        over = float(np.median(np.array(values) / base))
        more: dict[str, Any] = {"seconds": values, "over": over}
        sheet.add((name, ", ".join(f"{1e3 * v:.2f}" for v in values), f"{over:.2f}"), way=name, **more)
    sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--one", action="store_true", help="time one process")
    if parser.parse_args().one:
        timed()
    else:
        main()
