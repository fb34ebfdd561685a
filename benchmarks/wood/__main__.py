"""What wood costs and how well it keeps its energy: `python -m benchmarks.wood`; a minute or two on one core.

`python -m benchmarks.wood --fig42` runs the thesis' splinters instead (--rods, --vertices, --seeds, --modes).

Times are CPU seconds, the least of ten.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

from benchmarks.figures import Sheet, short
from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.model.bundle import lay
from solver.wood.stepping.explicit import march
from solver.wood.stepping.moment import begin
from solver.wood.stepping.stability import longest_step

from .shared.splinters import splinters

_PLAIN: dict[str, Any] = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}


def per_step(**values: Any) -> tuple[int, int, float, float]:
    """Return vertices, bonds, seconds per step, and the longest stable step [s]."""
    params = SOLVER.parse({**_PLAIN, **values})
    wood = lay(params, params.vertices)
    state, best = begin(wood), np.inf
    steps = max(200_000 // len(wood.motion.x), 4)
    for _ in range(10):
        begun = time.process_time()
        march(
            wood.motion,
            wood.rods,
            wood.turns,
            wood.bodies,
            wood.pins,
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


#: What the bonds' kernel reads for each bond: its vertex, five numbers [bytes].
_BOND = 4 + 5 * 8


def bandwidth() -> float:
    """Return bytes per CPU second that one core reads and writes in a long copy."""
    a, best = np.ones(8_000_000), np.inf
    b = a.copy()
    for _ in range(5):
        begun = time.process_time()
        np.copyto(b, a)
        best = min(best, time.process_time() - begun)
    return 2 * a.nbytes / best


def main() -> None:
    head = (
        "rods",
        "bonds",
        "ns per vertex and step",
        "longest step [s]",
        "times sqrt(rods)",
        "CPU s of 3 s at 0.4 of it",
    )
    sheet = Sheet("wood-cost", head, "wood")
    speed, cost, plain = bandwidth(), [], 0.0
    for rods in (50, 100, 200, 500, 1000, 2000):
        for extra in ({"reach": 0.0}, {"reach": 0.0, "twist": True}, {}) if rods == 200 else ({},):
            v, b, seconds, longest = per_step(rods=rods, bend=0.005, **extra)
            whole = 3 / (0.4 * longest) * seconds
            kind = f"{rods}" + ", no bonds" * (not b) + ", twist" * ("twist" in extra)
            spaced = f"{longest * rods**0.5:.1e}" if b else ""
            sheet.add(
                (kind, b, f"{seconds / v * 1e9:.0f}", f"{longest:.1e}", spaced, short(whole)),
                rods=rods, twist="twist" in extra, vertices=v, bonds=b, seconds_per_step=seconds, longest_step=longest,
            )  # fmt: skip
            if b:
                cost.append((rods, seconds, whole, (seconds - plain * v) / b))
            else:
                plain = plain or seconds / v
    slopes = {
        name: float(np.polyfit(np.log([c[0] for c in cost]), np.log([c[column] for c in cost]), 1)[0])
        for name, column in (("a step", 1), ("3 s", 2))
    }
    for name, slope in slopes.items():
        print(f"cost of {name} grows with rods to the power {slope:.2f}")
    print(
        f"a bond takes {cost[-1][3] * 1e9:.0f} ns of CPU at {cost[-1][0]} rods;"
        f" its {_BOND} bytes at {speed / 1e9:.1f} GB/s would take {_BOND / speed * 1e9:.1f} ns"
    )
    sheet.keep(powers_of_rods=slopes, ns_per_bond=cost[-1][3] * 1e9, bytes_per_second=speed)
    balance()


def balance() -> None:
    """Let the bent bundle of Fig. 4.1 swing freely for 4 ms, at three steps."""
    sheet = Sheet("wood-balance", ("step over the longest", "largest error of the energy balance", "slope"), "wood")
    longest = longest_step(lay(SOLVER.parse({}, preset="fig-4.1"), 30))
    times, last = tuple(np.linspace(2e-4, 4e-3, 20)), None
    for share in (0.4, 0.2, 0.1):
        params = SOLVER.parse({"step": share * longest}, preset="fig-4.1")
        off = float(SOLVER.solve(params, Need(stages=times)).residual.max())
        slope = f"{np.log2(last / off):.2f}" if last else ""
        sheet.add((share, f"{off:.1e}", slope), share=share, error=off)
        last = off
    sheet.keep()


def _asked() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fig42", action="store_true", help="run the splinters of Fig. 4.2")
    parser.add_argument("--rods", type=int, default=200)
    parser.add_argument("--vertices", type=int, default=30)
    parser.add_argument("--until", type=float, default=3.0, help="seconds that are simulated")
    parser.add_argument("--seeds", type=int, nargs="*", default=[1])
    parser.add_argument("--modes", nargs="+", choices=("scaled", "explicit"), default=["scaled"])
    parser.add_argument("--scaling", type=float, nargs="+", default=[1e4], help="masses over real ones when scaled")
    parser.add_argument("--no-elastic", action="store_true", help="leave the run without fracture out")
    parser.add_argument("--contact", nargs="+", choices=("yes", "no"), default=["yes"], help="whether rods touch")
    asked = parser.parse_args()
    if asked.fig42:
        masses = [1.0] * ("explicit" in asked.modes) + asked.scaling * ("scaled" in asked.modes)
        splinters(
            asked.rods,
            asked.vertices,
            asked.seeds,
            asked.until,
            masses,
            not asked.no_elastic,
            [word == "yes" for word in asked.contact],
        )
    else:
        main()


if __name__ == "__main__":
    _asked()
