"""What `solver.dehydration.accuracy` promises, measured: the roughness of eighths against that of the finest mesh.

python -m benchmarks.dehydration.meshes --te 0.04 --gamma 50 --n 18,26,36 --seeds 0,1,2

Every run is kept as soon as it is done, and found again the next time; runs of another version are dropped.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from benchmarks import figures
from benchmarks.figures import Row
from solver.contract import Context, Need, SolverError
from solver.dehydration import SOLVER, DehydrationParams, settings

NAME = "dehydration-meshes"
STAGES = (0.1, 0.15, 0.2, 0.25, 0.3)
_FIELDS = ("roughness", "buckle_count", "wavelength", "crossings")


def main() -> None:
    """Run what is missing, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--te", type=_numbers, default="0.04")
    parser.add_argument("--gamma", type=_numbers, default="10,30,50")
    parser.add_argument("--n", type=_counts, default="18,26,36,48", help="elements along an edge of the cubed sphere")
    parser.add_argument("--seeds", type=_counts, default="0,1,2")
    asked = parser.parse_args()
    kept = figures.load(NAME)["runs"] if NAME in figures.names() else []
    runs = [row for row in kept if row["version"] == SOLVER.version]
    asked_before = len(runs)
    runs = [row for row in runs if not _is_replaced(row, runs)]
    if len(runs) < asked_before:
        figures.keep(NAME, runs, "dehydration", threads=1)
    # coarse meshes and few seeds first: what is stopped early has measured something everywhere
    for n in asked.n:
        for te in asked.te:
            for gamma in asked.gamma:
                for seed in asked.seeds:
                    key = {"version": SOLVER.version, "te": te, "gamma": gamma, "n": n, "seed": seed}
                    if not any(key.items() <= row.items() for row in runs):
                        runs.append(key | measured(te, gamma, n, seed))
                        figures.keep(NAME, runs, "dehydration", threads=1)
                        print(runs[-1], file=sys.stderr, flush=True)


def _is_replaced(row: Row, runs: list[Row]) -> bool:
    """Return whether a row of means has its seeds' own runs beside it by now."""
    of = [other["seed"] for other in runs if all(other[k] == row[k] for k in ("te", "gamma", "n")) and "seed" in other]
    return "seeds" in row and set(row["seeds"]) <= set(of)


def measured(te: float, gamma: float, n: int, seed: int) -> Row:
    """Return the descriptors of an eighth with n elements an edge of the cubed sphere, at default's steps for them."""
    params = DehydrationParams.parse({"te": te, "gamma": gamma, "mirrors": "xyz", "seed": seed})
    need = SOLVER.settle(Need(stages=STAGES, quality="default", fields=_FIELDS))
    begin = time.process_time()
    try:
        with _edge(n):
            elements = settings.choose(params, "default", STAGES[-1]).elements
            result = SOLVER.run(params, need, Context())
    except SolverError as error:
        return {"failed": type(error).__name__, "cpu": time.process_time() - begin}
    row: Row = {name: result[name].values.tolist() for name in (*_FIELDS, "converged", "residual")}
    steps = int(result["iterations"].values[-1])
    return {"elements": elements, "steps": steps, **row, "cpu": time.process_time() - begin}


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.split(",")]


def _counts(text: str) -> list[int]:
    return [int(part) for part in text.split(",")]


@contextmanager
def _edge(n: int) -> Iterator[None]:
    """Give `default` a mesh of n elements an edge, however long waves are."""
    qualities, fewest = dict(settings._QUALITIES), settings._FEWEST_PER_WAVELENGTH
    settings._QUALITIES["default"] = dataclasses.replace(qualities["default"], per_wavelength=0.1, fewest=n, most=n)
    settings._FEWEST_PER_WAVELENGTH = 0.1
    try:
        yield
    finally:
        settings._QUALITIES.update(qualities)
        settings._FEWEST_PER_WAVELENGTH = fewest


if __name__ == "__main__":
    main()
