"""Our implicit solver on the peers' common case before buckling: python -m benchmarks.dehydration.sphere_ours --json.

Sphere with skin 1 to 1.04, rigid stone 0.4, mu 1 and 10, kappa = 1000 mu, core shrunk by theta in one load step on
one octant, as the peers. Errors are of the radius at all nodes and at random points between them, against the radial
reference at the same kappa and against the incompressible closed form. "cold" is the first solution in this process,
loading of compiled code included.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np

from solver.dehydration.fresh.closed_form import sphere_radius
from solver.dehydration.implicit import base_state
from solver.dehydration.params import DehydrationParams
from tests.solver._radial_reference import radial_reference

FRUIT = DehydrationParams()
KAPPA_RATIO = 1000.0


def errors(fresh: Any, deformed: Any, theta: float, kappa_ratio: float) -> dict[str, float]:
    reference = radial_reference(theta, FRUIT.stone[0], FRUIT.exocarp_thickness, FRUIT.modulus_ratio, kappa_ratio)
    before, after = (np.linalg.norm(x, axis=-1) for x in (fresh, deformed))
    return {
        "error_radial_reference": float(np.abs(after - reference(before)).max()),
        "error_closed_form": float(np.abs(after - sphere_radius(before, theta, FRUIT.stone[0])).max()),
    }


def timed(run: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    wall, cpu = time.perf_counter(), time.process_time()
    result = run()
    return result, {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}


def implicit(theta: float, n: int, layers: int) -> dict[str, Any]:
    def run() -> Any:
        return base_state(FRUIT, 1 - theta, n=n, layers=layers, kappa_ratio=KAPPA_RATIO, symmetry="octant")

    (_, cold), (state, warm) = timed(run), timed(run)
    rng = np.random.default_rng(0)
    rays = rng.normal(size=(2000, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    points = rays * rng.uniform(FRUIT.stone[0], 1 + FRUIT.exocarp_thickness, 2000)[:, None]
    between = errors(points, state(points), theta, KAPPA_RATIO)["error_radial_reference"]
    return {
        "unknowns": state.unknowns,
        "newton": state.state.steps,
        "residual": state.residuals[-1][1][-1],
        "cold": cold,
        "warm": warm,
        **errors(state.nodes, state.displaced, theta, KAPPA_RATIO),
        "error_between_nodes": between,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--theta", type=float, default=0.95)
    parser.add_argument("--n", type=int, default=8, help="elements per edge of the cubed sphere")
    parser.add_argument("--layers", type=int, default=4, help="core layers")
    parser.add_argument("--json", action="store_true", help="one line of JSON")
    options = parser.parse_args()
    row = {"theta": options.theta, "n": options.n, "layers": options.layers}
    row |= implicit(options.theta, options.n, options.layers)
    print(json.dumps(row) if options.json else "\n".join(f"{key}: {value}" for key, value in row.items()))


if __name__ == "__main__":
    main()
