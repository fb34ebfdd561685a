"""Whether buckles stand from the onset on: python -m benchmarks.dehydration.precision.nearly.

The exact onset of spheres, and the roughness of eighths at stages before it, at it and past it (record
dehydration-nearly).
"""

from __future__ import annotations

import argparse
import time

from benchmarks.figures import Sheet
from solver.contract import Need
from solver.dehydration import SOLVER, DehydrationParams
from solver.dehydration.bifurcation import onset
from solver.dehydration.settings import choose

_FRUITS = ((0.02, 10), (0.04, 10), (0.04, 30), (0.1, 10), (0.1, 30))
#: Stages, over the onset of flesh.
_PAST = (0.95, 0.98, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5)
_HEAD = ("te", "gamma", "onset", *(f"{past:g}" for past in _PAST), "stages settled", "processor seconds")


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    sheet = Sheet("dehydration-nearly", _HEAD, "dehydration")
    for te, gamma in _FRUITS:
        params = SOLVER.parse({"te": te, "gamma": gamma, "mirrors": "xyz"})
        assert isinstance(params, DehydrationParams)
        settings = choose(params, "preview", 0.1)
        begins = onset(params, kappa_ratio=settings.kappa_ratio).s_cr
        assert begins is not None
        need = Need(stages=tuple(round(begins * past, 5) for past in _PAST), quality="preview", fields=("roughness",))
        cpu = time.process_time()
        run = SOLVER.solve(params, SOLVER.settle(need, of=(params,)))
        cpu = time.process_time() - cpu
        rough, converged = (run["roughness"].values / te).tolist(), run["converged"].values.tolist()
        sheet.add(
            (f"{te:g}", gamma, f"{begins:.4f}", *(f"{value:.2f}" for value in rough),
             f"{sum(converged)} of {len(converged)}", f"{cpu:.0f}"),
            te=te, gamma=gamma, onset=begins, past=list(_PAST), roughness=rough, converged=converged, cpu=cpu,
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main()
