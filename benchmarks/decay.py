"""Error and run time of the decay solver by mesh: the whole model against its finest mesh, at shared points.

    python -m benchmarks.decay [finest level] [preset] [days]

Level 5 is preview, 6 default, 7 fine. Seconds are CPU time of one thread, without the mesh.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from solver.contract import Context
from solver.decay import SOLVER
from solver.decay.settings import choose
from solver.decay.stepping import march
from solver.decay.surface import geodesic
from solver.decay.system import System


def solve(preset: str, level: int, tolerance: float, days: float) -> dict[str, Any]:
    params = SOLVER.parse({}, preset)
    system = System(params, level, True)
    system.advance(system.start, 0.0, 1e-6)  # compiled before the clock runs
    begun = time.process_time()
    (end,) = march(system, (days,), tolerance, choose(params, "default").longest, Context())
    seconds = time.process_time() - begun
    assert system.mould is not None
    assert end.state.mould is not None
    densities = [state.u + state.v for state in (end.state.rot, end.state.mould)]
    return {"system": system, "densities": densities, "seconds": seconds, "steps": end.steps}


def error(level: int, run: dict[str, Any], finest: int, reference: dict[str, Any]) -> list[float]:
    """Return the relative L2 errors of rot and mould: every point of a coarse mesh is one of the finer."""
    _, same = KDTree(geodesic(finest)[0]).query(geodesic(level)[0])
    area = run["system"].surface.area
    found = []
    for ours, theirs in zip(run["densities"], reference["densities"], strict=True):
        there = theirs[same]
        found.append(float(np.sqrt(np.sum(area * (ours - there) ** 2) / np.sum(area * there**2))))
    return found


def main(finest: int = 7, preset: str = "apple", days: float = 10.0) -> None:
    tolerances = {5: 1e-4, 6: 3e-5, 7: 1e-5}
    reference = solve(preset, finest, tolerances.get(finest, 1e-4) / 4, days)
    rows = []
    for level in range(finest - 3, finest):
        run = solve(preset, level, tolerances.get(level, 1e-4), days)
        rot, mould = error(level, run, finest, reference)
        row = {"level": level, "vertices": len(run["densities"][0]), "steps": run["steps"]}
        rows.append(row | {"seconds": round(run["seconds"], 3), "error_rot": rot, "error_mould": mould})
    print(json.dumps({"preset": preset, "days": days, "reference": finest, "runs": rows}, indent=2))
    print(f"reference: {reference['steps']} steps, {reference['seconds']:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*(kind(text) for kind, text in zip((int, str, float), given, strict=False)))
