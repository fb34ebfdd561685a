"""Error and run time of the decay solver by mesh: the whole model against a far finer mesh, at the coarse points.

    python -m benchmarks.decay [cells of the reference] [preset,preset] [days]

32 cells are preview, 96 default, 192 fine. Seconds are CPU time of one thread, without the mesh. The reference is
itself off: where errors are of second order, one against a mesh of twice the cells is a quarter too small.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from benchmarks.figures import Sheet
from solver.contract import Context
from solver.decay import SOLVER
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose
from solver.decay.surfaces.surface import geodesic, shares_at


def solve(preset: str, cells: int, tolerance: float, days: float) -> dict[str, Any]:
    params = SOLVER.parse({}, preset)
    system = System(params, cells, True)
    system.advance(system.start, 0.0, 1e-6)  # compiled before the clock runs
    begun = time.process_time()
    (end,) = march(system, (days,), tolerance, choose(params, "default").longest, Context())
    seconds = time.process_time() - begun
    assert system.mould is not None
    assert end.state.mould is not None
    densities = [state.u + state.v for state in (end.state.rot, end.state.mould)]
    return {"system": system, "densities": densities, "seconds": seconds, "steps": end.steps}


def errors(cells: int, run: dict[str, Any], finest: int, reference: dict[str, Any]) -> list[float]:
    """Return the relative L2 errors of rot and mould; a mesh of twice the cells holds every point of this one."""
    there = shares_at(*geodesic(finest), geodesic(cells)[0])
    area = run["system"].surface.area
    found = []
    for ours, theirs in zip(run["densities"], reference["densities"], strict=True):
        exact = there @ theirs
        found.append(float(np.sqrt(np.sum(area * (ours - exact) ** 2) / np.sum(area * exact**2))))
    return found


_QUALITY = {32: "preview", 96: "default", 192: "fine"}


def main(finest: int = 192, presets: str = "apple-paper,apple", days: float = 10.0) -> None:
    head = ("preset", "quality", "cells", "points", "steps", "seconds", "error of rot", "error of mould")
    sheet, references = Sheet("decay-mesh", head, "decay"), {}
    for preset in presets.split(","):
        reference = solve(preset, finest, 5e-6, days)
        references[preset] = {"cells": finest, "steps": reference["steps"], "seconds": reference["seconds"]}
        _rows(sheet, preset, finest, reference, days)
    sheet.keep(references=references)


def _rows(sheet: Sheet, preset: str, finest: int, reference: dict[str, Any], days: float) -> None:
    for cells in (24, 32, 48, 64, 96, 128, 192):
        if 2 * cells > finest:
            break
        run = solve(preset, cells, 1e-4 if cells < 64 else 3e-5 if cells < 192 else 1e-5, days)
        rot, mould = errors(cells, run, finest, reference)
        row = {"cells": cells, "vertices": len(run["densities"][0]), "steps": run["steps"]}
        row |= {"seconds": round(run["seconds"], 3), "error_rot": rot, "error_mould": mould}
        sheet.add(
            (preset, _QUALITY.get(cells, ""), cells, f"{row['vertices']:,}".replace(",", " "), run["steps"],
             f"{run['seconds']:.2g}", f"{rot:.1e}", f"{mould:.1e}"),
            preset=preset, days=days, **row,
        )  # fmt: skip


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*(kind(text) for kind, text in zip((int, str, float), given, strict=False)))
