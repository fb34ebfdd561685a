"""What wood costs and how well it keeps its energy: `python -m benchmarks.wood`; a minute or two on one core.

`python -m benchmarks.wood --fig42` runs the thesis' splinters instead (--rods, --vertices, --seeds, --explicit).

Times are CPU seconds, the least of three.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.bundle import lay
from solver.wood.explicit import march
from solver.wood.moment import begin
from solver.wood.stability import longest_step

from .wood_splinters import splinters

_PLAIN: dict[str, Any] = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}


def per_step(**values: Any) -> tuple[int, int, float, float]:
    """Return vertices, bonds, seconds per step, and the longest stable step [s]."""
    params = SOLVER.parse({**_PLAIN, **values})
    wood = lay(params, params.vertices)
    state, best = begin(wood), np.inf
    steps = max(200_000 // len(wood.motion.x), 4)
    for _ in range(4):
        begun = time.process_time()
        march(
            wood.motion,
            wood.rods,
            wood.bonds,
            wood.turns,
            wood.bodies,
            state.scratch,
            wood.turning,
            0.0,
            1e-8,
            steps,
            0.0,
            state.books,
            state.impulse,
        )
        best = min(best, (time.process_time() - begun) / steps)
    return wood.grid.size, len(wood.bonds.i), best, longest_step(wood)


def main() -> None:
    print("rods  bonded  twist  vertices    bonds  ns/vertex-step  longest step [s]  CPU s per 3 s at 0.4 of it")
    for rods in (50, 100, 200, 500, 1000, 2000):
        for extra in ({"reach": 0.0}, {"reach": 0.0, "twist": True}, {}) if rods == 200 else ({},):
            v, b, seconds, longest = per_step(rods=rods, bend=0.005, **extra)
            kind = f"{'yes' if b else 'no':>6}  {'yes' if 'twist' in extra else 'no':>5}"
            print(
                f"{rods:4d}  {kind}  {v:8d} {b:8d}  {seconds / v * 1e9:14.0f}  {longest:16.2e}"
                f"  {3 / (0.4 * longest) * seconds:10.0f}",
                flush=True,
            )
    print("\nFig. 4.1: a bent bundle of 50 rods swings freely; largest error of the energy balance")
    longest = longest_step(lay(SOLVER.parse({}, preset="fig-4.1"), 30))
    times, last = tuple(np.linspace(2e-4, 4e-3, 20)), None
    for share in (0.4, 0.2, 0.1):
        params = SOLVER.parse({"step": share * longest}, preset="fig-4.1")
        off = float(SOLVER.solve(params, Need(stages=times)).residual.max())
        slope = f", slope {np.log2(last / off):.2f}" if last else ""
        print(f"step {share:.1f} of the longest: {off:.2e}{slope}", flush=True)
        last = off


def _asked() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fig42", action="store_true", help="run the splinters of Fig. 4.2")
    parser.add_argument("--rods", type=int, default=200)
    parser.add_argument("--vertices", type=int, default=30)
    parser.add_argument("--until", type=float, default=3.0, help="seconds that are simulated")
    parser.add_argument("--seeds", type=int, nargs="*", default=[1])
    parser.add_argument("--explicit", action="store_true", help="run each seed explicitly too")
    parser.add_argument("--no-elastic", action="store_true", help="leave the run without fracture out")
    asked = parser.parse_args()
    if asked.fig42:
        splinters(asked.rods, asked.vertices, asked.seeds, asked.until, asked.explicit, not asked.no_elastic)
    else:
        main()


if __name__ == "__main__":
    _asked()
