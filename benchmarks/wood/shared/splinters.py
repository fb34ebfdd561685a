"""The splinter run of Fig. 4.2: what three seconds cost, and what breaks, on real and on scaled masses.

`python -m benchmarks.wood --fig42 --modes scaled explicit`; runs on real masses take 80 s a seed at 24 rods and 75
minutes at 200. Kept as wood-fig42-RODS.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.figures import Sheet
from solver.contract import Need, SolverError
from solver.wood import SOLVER, WoodParams

__all__ = ["splinters"]

_FIELDS = ("elastic_energy", "broken_rods", "broken_bonds")
_HEAD = (
    "masses over real ones",
    "seed",
    "rods touch",
    "breaks of rods",
    "of bonds",
    "CPU s",
    "wall s",
    "worst balance",
)


def _run(values: dict[str, Any], until: float) -> dict[str, Any]:
    """Return what became of a run."""
    params = SOLVER.parse({"mode": "explicit", **values}, preset="fig-4.2")
    assert isinstance(params, WoodParams)
    need = Need(stages=tuple(until * n / 10 for n in range(1, 11)), fields=_FIELDS, quality="preview")
    told: dict[str, Any] = {
        "rods": params.rods,
        "seed": params.seed,
        "scaling": params.mass_scaling,
        "fracture": params.fracture,
        "touching": params.touching,
    }
    begun, clock = time.process_time(), time.perf_counter()
    try:
        found = SOLVER.solve(params, need)
    except SolverError as failed:
        told["failed"] = str(failed)
        if failed.partial is None:
            return told
        found = failed.partial
    return {
        **told,
        "vertices": int(found.attrs["vertices"]),
        "bonds": int(found.attrs["bonds"]),
        "until": float(found.stage[-1]),
        "cpu": time.process_time() - begun,
        "wall": time.perf_counter() - clock,
        "broken_rods": int(found.broken_rods[-1]),
        "broken_bonds": int(found.broken_bonds[-1]),
        "elastic_energy": found.elastic_energy.values.tolist(),
        "balance": float(found.residual.max()),
    }


def _cells(run: dict[str, Any]) -> list[str]:
    seed = str(run["seed"]) if run["fracture"] != "none" else "none breaks"
    begun = [f"{run['scaling']:.0f}", seed, "yes" if run["touching"] else "no"]
    if "broken_rods" not in run:
        return [*begun, run["failed"], *[""] * 4]
    said = f", ended at {run['until']:.2f} s: {run['failed']}" if "failed" in run else ""
    counts = [str(run["broken_rods"]), f"{run['broken_bonds']} of {run['bonds']}{said}"]
    return [*begun, *counts, f"{run['cpu']:.1f}", f"{run['wall']:.1f}", f"{run['balance']:.1e}"]


def splinters(
    rods: int,
    vertices: int,
    seeds: Sequence[int],
    until: float,
    masses: Sequence[float],
    elastic: bool,
    contact: Sequence[bool] = (True,),
) -> None:
    """Print a row for every seed and mass, and those without fracture; explicit runs take half the longest step.

    contact: whether rods touch, all of them in turn.
    """
    sheet = Sheet(f"wood-fig42-{rods}", _HEAD, "wood")
    # preview's step, and half of its edges: the same bundle
    twice: dict[str, Any] = {"rods": rods, "vertices": 2 * vertices - 1}
    for scaling in masses:
        values = {**twice, "mass_scaling": scaling} if scaling > 1 else twice
        # compiles, so that the rows do not
        _run({**values, "rods": 8, "vertices": 6}, 1e-3)
        if elastic and scaling > 1:
            run = _run({**values, "fracture": "none"}, until)
            sheet.add(_cells(run), **run)
        for touching in contact:
            runs = []
            for seed in seeds:
                run = _run({**values, "seed": seed, "rod_contact": touching}, until)
                sheet.add(_cells(run), **run)
                runs += [run] if "failed" not in run else []
            if len(runs) > 1:  # a row of no run of its own
                mean = {name: np.mean([run[name] for run in runs]) for name in ("broken_rods", "broken_bonds", "cpu")}
                counts = [f"{mean[name]:.0f}" for name in ("broken_rods", "broken_bonds")]
                said = "yes" if touching else "no"
                sheet.rows.append(
                    [f"{scaling:.0f}", f"mean of {len(runs)}", said, *counts, f"{mean['cpu']:.1f}", "", ""]
                )
    sheet.keep(until=until)
