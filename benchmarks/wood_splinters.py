"""The splinter run of Fig. 4.2: what three seconds cost, and what breaks, implicitly and explicitly.

`python -m benchmarks.wood --fig42`; explicit runs take some minutes a seed at 24 rods, so they come with `--explicit`.
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
    "rods  vertices  seed  fracture      mode  until [s]  CPU s  breaks of rods  of bonds         bonds  worst balance"
)


def _run(values: dict[str, Any], until: float, quality: Any) -> str:
    """Return a row of the table."""
    params = SOLVER.parse(values, preset="fig-4.2")
    need = Need(stages=tuple(until * n / 10 for n in range(1, 11)), fields=_FIELDS, quality=quality)
    begun = time.process_time()
    try:
        found, error = SOLVER.solve(params, need), ""
    except SolverError as failed:
        if failed.partial is None:
            return f"{failed}"
        found, error = failed.partial, f"  {failed}"
    cpu = time.process_time() - begun
    return (
        f"{found.attrs['rods']:4d}  {found.attrs['vertices']:8d}  {params.seed:4d}"
        f"  {params.fracture:>8}  {params.mode:>8}"
        f"  {float(found.stage[-1]):9.2f}  {cpu:5.0f}  {int(found.broken_rods[-1]):14d}"
        f"  {int(found.broken_bonds[-1]):8d}  {found.attrs['bonds']:12d}  {float(found.residual.max()):13.1e}{error}"
    )


def splinters(rods: int, vertices: int, seeds: Sequence[int], until: float, explicit: bool, elastic: bool) -> None:
    """Print a row for every seed and mode; explicit runs take the longest step that is stable by a fifth."""
    print(_HEAD, flush=True)
    common = {"rods": rods, "vertices": vertices}
    implicit = {"mode": "implicit", "step": 1 / 60}
    # compiles, so that the rows do not
    _run({"rods": 8, "vertices": 6, **implicit}, 0.4, "default")
    if elastic:
        print(_run({**common, **implicit, "fracture": "none"}, until, "default"), flush=True)
    for seed in seeds:
        print(_run({**common, **implicit, "seed": seed}, until, "default"), flush=True)
        if explicit:
            # preview's step, and half of its edges: the same bundle
            twice = {"rods": rods, "vertices": 2 * vertices - 1, "seed": seed}
            print(_run(twice, until, "preview"), flush=True)
