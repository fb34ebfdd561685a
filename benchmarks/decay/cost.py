"""What a step of rot and mould costs, by points and by infected area: python -m benchmarks.decay.cost.

A colony that covers a share of the sphere, both organisms; CPU milliseconds of a step, the least of five, and slopes
of log cost over log points and of cost over listed points.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from benchmarks.figures import Sheet, short
from solver.decay import DecayParams
from solver.decay.fields.both import Both
from solver.decay.fields.diffusion import listed_around
from solver.decay.fields.system import System

_CELLS = (32, 64, 96, 128)
_SHARES = (0.01, 0.1, 0.4, 1.0)
#: A step of default quality [day].
_STEP = 0.04


def measured(cells: int, share: float) -> tuple[int, float]:
    """Return how many points are listed, and milliseconds of a step, with colonies on a share of the sphere."""
    system = System(DecayParams(wounds=(), climate="paper"), cells, True)
    s = system.surface
    inside = s.points[:, 1] > np.linalg.norm(s.points, axis=1) * (1 - 2 * share)
    assert system.mould is not None
    assert system.start.mould is not None
    rot, mould = (
        state._replace(u=np.where(inside, 0.5 * layer.rates.cap, 0.0))
        for state, layer in ((system.start.rot, system.rot), (system.start.mould, system.mould))
    )
    state = Both(rot, mould)
    spent = []
    for _ in range(5):
        begun = time.process_time()
        system.advance(state, 0.0, _STEP)
        spent.append(time.process_time() - begun)
    return len(listed_around(rot.u, 1e-8 * system.rot.rates.cap, 3, s.start, s.near)), 1e3 * min(spent)


def main() -> None:
    """Print the table and the slopes."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    measured(8, 0.5)
    shares = [f"{100 * share:g} %" for share in _SHARES]
    sheet = Sheet("decay-cost", ("points", *shares, "idle + per listed point"), "decay")
    whole = []
    for cells in _CELLS:
        found = [measured(cells, share) for share in _SHARES]
        listed, ms = np.array(found).T
        slope, idle = np.polyfit(listed, ms, 1)
        whole.append(ms)
        count = 10 * cells**2 + 2
        sheet.add(
            (f"{count:,}".replace(",", " "), *(f"{short(m)} ms" for m in ms),
             f"{short(idle)} ms + {short(1e6 * slope)} ns"),
            points=count, listed=listed.tolist(), ms=ms.tolist(), idle_ms=idle, ns_per_listed_point=1e6 * slope,
        )  # fmt: skip
    points = np.log([10 * cells**2 + 2 for cells in _CELLS])
    slopes = [float(np.polyfit(points, np.log(ms), 1)[0]) for ms in np.array(whole).T]
    print("slope over points: " + ", ".join(f"{slope:.2f}" for slope in slopes))
    sheet.keep(slope_over_points=slopes)


if __name__ == "__main__":
    main()
