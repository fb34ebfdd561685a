"""Where settled stages go when they are left to settle on: python -m benchmarks.dehydration.stress.onward [--quick].

A stage ends where its forces balance, its volumes are right and its surface drifts by little. Ways can be so soft that
this is not where it would come to rest in the end. So each settled stage goes on, on a copy and by the settling's own
turns, for a third of the steps that a stage may take at most: by how much its roughness changes, how far its surface
goes over its roughness (rms), and which part of its strain energy it gives up. Eighths of spheres, seeds 0 and 1, kept
as dehydration-onward.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import Row, Sheet, markdown
from solver.arrays import Floats, Singles
from solver.contract import Context
from solver.contract.errors import SolverError
from solver.dehydration import SOLVER, path, settle
from solver.dehydration.motion import Motion
from solver.dehydration.settings import choose

__all__ = ["table"]

_HEAD = (
    *("quality", "te", "gamma", "seed", "s", "steps", "steps on", "roughness [r1]", "roughness on"),
    *("way over roughness", "energy given up", "residual on", "drift on [te]"),
)
_STAGES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
_FRUITS = (
    *(("preview", 0.04, 10.0), ("preview", 0.04, 30.0), ("default", 0.1, 10.0), ("default", 0.04, 10.0)),
    *(("default", 0.04, 30.0), ("fine", 0.04, 10.0), ("default", 0.02, 10.0), ("preview", 0.01, 10.0)),
)
_SEEDS = (0, 1)
#: Part of the steps of the longest settling that a stage goes on for.
_PART = 1 / 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the first fruit alone")
    asked = parser.parse_args()
    sheet = Sheet("dehydration-onward", _HEAD, "dehydration")
    for quality, te, gamma in _FRUITS[:1] if asked.quick else _FRUITS:
        for seed in _SEEDS[:1] if asked.quick else _SEEDS:
            for row in _run(quality, te, gamma, seed):
                _add(sheet, row)
    if not asked.quick:
        sheet.keep()


def _run(quality: str, te: float, gamma: float, seed: int) -> list[Row]:
    """March an eighth, let each of its settled stages go on, and return what they did."""
    params = SOLVER.parse({"te": te, "gamma": gamma, "mirrors": "xyz", "seed": seed})
    rows: list[Row] = []
    real = path.settle

    def spied(
        motion: Motion, state: NDArray[np.int32], velocity: Singles, rest: Floats, s: float, *asked: Any
    ) -> settle.State:
        steps, begin = motion.steps, time.process_time()
        found = real(motion, state, velocity, rest, s, *asked)
        if any(abs(s - stage) < 1e-9 for stage in _STAGES) and s > motion.settings.start:
            row = {"quality": quality, "te": te, "gamma": gamma, "seed": seed, "s": s, "steps": motion.steps - steps}
            rows.append(row | _onward(motion, state, found) | {"cpu": time.process_time() - begin})
        return found

    path.settle = spied
    try:
        road = path.Path(params, choose(params, quality, _STAGES[-1]), Context())
        for stage in _STAGES:
            road.stage(stage, _STAGES[-1])
    except SolverError as error:
        print(f"{quality}, te {te:g}, gamma {gamma:g}, seed {seed}: {error}")
    finally:
        path.settle = real
    return rows


def _onward(motion: Motion, state: NDArray[np.int32], found: settle.State) -> Row:
    """Let a copy of a settled state go on; the motion is as before afterwards."""
    settings, s, rest = motion.settings, found.shrinkage, found.rest
    masses, steps = motion.masses, motion.steps
    on, speed = state.copy(), np.zeros((len(state), 4), np.float32)
    here = motion.surface(on)
    while motion.steps - steps < _PART * settings.settle_steps:
        rest = settle._swung(motion, on, speed, rest, s)
        _, residual, drift = settle._calmed(motion, on, speed, rest, s)
        rest = settle._followed(motion, on, rest, s, settle._SHARE)
    there = motion.surface(on)
    rough, rougher = (float(np.linalg.norm(surface, axis=1).std()) for surface in (here, there))
    way = settle._way(motion, on, here) * motion.params.exocarp_thickness
    spent = motion.steps - steps
    energies = [motion.marched_energy(each, rest, s) for each in (state, on)]
    motion.masses, motion.steps = masses, steps
    return {
        "steps_on": spent,
        "roughness": rough,
        "rougher": rougher / rough - 1,
        "way": way / rough,
        "given_up": 1 - energies[1] / energies[0],
        "residual": residual,
        "drift": drift,
    }


def _add(sheet: Sheet, row: Row) -> None:
    sheet.add(
        (
            *(row["quality"], f"{row['te']:g}", f"{row['gamma']:g}", row["seed"], f"{row['s']:g}", row["steps"]),
            *(row["steps_on"], f"{row['roughness']:.4f}", f"{100 * row['rougher']:+.1f} %", f"{row['way']:.2f}"),
            *(f"{100 * row['given_up']:.2f} %", f"{row['residual']:.1e}", f"{row['drift']:.1e}"),
        ),
        **row,
    )


def table(record: Row) -> str:
    """Return the table of a record: a line for each fruit, its stages side by side, seeds with a comma."""
    cases: dict[tuple[str, float, float], list[Row]] = {}
    for run in record["runs"]:
        cases.setdefault((run["quality"], run["te"], run["gamma"]), []).append(run)
    stages = sorted({run["s"] for run in record["runs"]})
    lines = []
    for (quality, te, gamma), runs in cases.items():
        at = [[run for run in runs if run["s"] == stage] for stage in stages]
        lines.append(
            [
                *(quality, f"{te:g}", f"{gamma:g}"),
                "; ".join(", ".join(f"{100 * run['rougher']:+.0f}" for run in own) for own in at if own) + " %",
                "; ".join(", ".join(f"{run['way']:.2f}".lstrip("0") for run in own) for own in at if own),
                f"{100 * max(run['given_up'] for run in runs):.1f} %",
            ]
        )
    changes = ("roughness changes by", "surface goes, over roughness", "energy given up, at most")
    return markdown(("quality", "te", "gamma", *changes), lines)


if __name__ == "__main__":
    main()
