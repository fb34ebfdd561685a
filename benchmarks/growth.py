"""Seconds to equal residual: quasi-Newton, L-BFGS and conjugate gradients on a growing disc, in one run.

python -m benchmarks.growth [vertices ...]   prints a table; CPU seconds of one thread, kernels compiled beforehand.
"""

from __future__ import annotations

import sys
import time

from threadpoolctl import threadpool_limits

from solver.contract import NotConverged
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams

_CASES = {
    "leaf rim 3 %": (
        {"shape": "disc", "thickness": 0.02, "curved": False},
        {
            "kind": "surface",
            "where": {"kind": "band", "along": "radius", "low": 0.6, "high": 1.0},
            "stretch": (1.03, 1.0),
        },
    ),
    "sphere spot 3 %": (
        {"shape": "sphere", "thickness": 0.02},
        {"kind": "spot", "at": (0, 0, 1), "stretch": (1.03, 1.03)},
    ),
}
_STEPS, _PATIENCE = 4, 3000


def measure(values: dict, tool: dict, vertices: int, way: str) -> str:
    params = GrowthParams.parse({**values, "tools": [tool], "step": 1.0, "remesh": 0, "solver": way})
    engine = Engine(params, vertices, 1e-3, most=_PATIENCE)
    seconds: list[float] = []
    for step in range(_STEPS):
        begun = time.process_time()
        try:
            engine.advance(1e9, until=step + 1.0)
        except NotConverged as error:
            return f"none in {_PATIENCE} iterations, {time.process_time() - begun:.1f} s, residual {error.residual:.0e}"
        seconds.append(time.process_time() - begun)
    return f"{sum(seconds) / _STEPS:.3f} s a step, {engine.state.iterations / _STEPS:.0f} iterations"


def main(sizes: list[int]) -> None:
    with threadpool_limits(1, user_api="blas"):
        for values, tool in _CASES.values():  # compile
            measure(values, tool, 100, "quasi_newton")
        for vertices in sizes:
            for name, (values, tool) in _CASES.items():
                for way in ("quasi_newton", "lbfgs", "cg"):
                    print(f"{vertices:6d} {name:16s} {way:13s} {measure(values, tool, vertices, way)}", flush=True)


if __name__ == "__main__":
    main([int(v) for v in sys.argv[1:]] or [2600, 10_000])
