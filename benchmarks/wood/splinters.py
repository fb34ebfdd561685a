"""The splinter run of Fig. 4.2: what three seconds cost, and what breaks, on real and on scaled masses.

`python -m benchmarks.wood --fig42 --modes scaled explicit`; runs on real masses take 80 s a seed at 24 rods and 75
minutes at 200.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from solver.contract import Need, SolverError
from solver.wood import SOLVER

__all__ = ["splinters"]

_FIELDS = ("elastic_energy", "broken_rods", "broken_bonds")
_HEAD = (
    "rods  vertices  seed  fracture      mode  scaling  until [s]  CPU s  wall s  breaks of rods  of bonds"
    "         bonds  worst balance"
)
#: Masses over real ones in the runs on scaled masses.
_SCALING = 1e4


def _run(values: dict[str, Any], until: float) -> str:
    """Return a row of the table."""
    params = SOLVER.parse(values, preset="fig-4.2")
    need = Need(stages=tuple(until * n / 10 for n in range(1, 11)), fields=_FIELDS, quality="preview")
    begun, clock = time.process_time(), time.perf_counter()
    try:
        found, error = SOLVER.solve(params, need), ""
    except SolverError as failed:
        if failed.partial is None:
            return f"{failed}"
        found, error = failed.partial, f"  {failed}"
    cpu, wall = time.process_time() - begun, time.perf_counter() - clock
    return (
        f"{found.attrs['rods']:4d}  {found.attrs['vertices']:8d}  {params.seed:4d}"
        f"  {params.fracture:>8}  {params.mode:>8}  {params.mass_scaling:7.0f}"
        f"  {float(found.stage[-1]):9.2f}  {cpu:5.0f}  {wall:6.0f}  {int(found.broken_rods[-1]):14d}"
        f"  {int(found.broken_bonds[-1]):8d}  {found.attrs['bonds']:12d}  {float(found.residual.max()):13.1e}{error}"
    )


def splinters(
    rods: int, vertices: int, seeds: Sequence[int], until: float, modes: Sequence[str], elastic: bool
) -> None:
    """Print a row for every seed and mode, and those without fracture; explicit runs take 0.8 of the longest step."""
    print(_HEAD, flush=True)
    # preview's step, and half of its edges: the same bundle
    twice: dict[str, Any] = {"rods": rods, "vertices": 2 * vertices - 1}
    asked: dict[str, dict[str, Any]] = {"explicit": twice, "scaled": {**twice, "mass_scaling": _SCALING}}
    for mode in modes:
        values = asked[mode]
        # compiles, so that the rows do not
        _run({**values, "rods": 8, "vertices": 6}, 1e-3)
        for seed in ("elastic", *seeds) if elastic and mode != "explicit" else seeds:
            own = {"fracture": "none"} if seed == "elastic" else {"seed": seed}
            print(_run({**values, **own}, until), flush=True)
