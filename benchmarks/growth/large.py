"""Seconds of a step of growth on a large mesh, by the clock and of the processor, kernels compiled beforehand.

    python -m benchmarks.growth.large [vertices ...]

A flat disc whose rim grows and buckles in the first step, and a sphere with a spot, by 3 % in each step, remeshed as
edges grow long; every step to a residual of 1e-3, with the look whether parts meet. The goal is 5 s a step at 100,000
vertices.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from benchmarks.growth.__main__ import CASES
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.coarser import FEWEST

_STEPS = 4


def steps(values: dict[str, Any], tool: dict[str, Any], vertices: int) -> Iterator[dict[str, float]]:
    """Yield what each step took: seconds, those of the processor, steps of the minimiser, vertices afterwards."""
    engine = Engine(GrowthParams.parse({**values, "tools": [tool], "step": 1.0, "remesh": 1.3}), vertices, 1e-3)
    for step in range(_STEPS):
        begun, clock, before = time.process_time(), time.perf_counter(), engine.state.iterations
        engine.advance(1e9, until=step + 1.0)
        took, spent = time.perf_counter() - clock, time.process_time() - begun
        count = engine.state.iterations - before
        yield {
            "seconds": took, "cpu": spent, "iterations": count, "vertices": len(engine.state.x),
            "residual": engine.residual,
        }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vertices", type=int, nargs="*", default=[100_000])
    given = parser.parse_args()
    with threadpool_limits(1, user_api="blas"):
        for values, tool in CASES.values():  # compile, what serves large meshes alone as well
            list(steps(values, tool, FEWEST + 1000))
        sheet = Sheet("growth-large", ("case", "step", "vertices", "s", "CPU s", "iterations", "residual"), "growth")
        for vertices in given.vertices:
            for name, (values, tool) in CASES.items():
                for step, found in enumerate(steps(values, tool, vertices), 1):
                    took = (f"{found['seconds']:.1f}", f"{found['cpu']:.1f}")
                    cells = (*took, f"{found['iterations']:.0f}", f"{found['residual']:.0e}")
                    sheet.add((name, step, found["vertices"], *cells), case=name, step=step, **found)
        sheet.keep()


if __name__ == "__main__":
    main()
