"""How far past the onset a run still hands over the smooth sphere: python -m benchmarks.dehydration.precision.nearly.

The exact onset at the bulk modulus of flesh and at that of the march, and the roughness of eighths at stages between
and past them (record dehydration-nearly).
"""

from __future__ import annotations

import argparse

from benchmarks.figures import Sheet
from solver.contract import Need
from solver.dehydration import SOLVER, DehydrationParams
from solver.dehydration.bifurcation import onset
from solver.dehydration.settings import choose

_FRUITS = ((0.02, 10), (0.04, 10), (0.04, 30), (0.1, 10), (0.1, 30))
#: Stages, over the onset of flesh.
_PAST = (0.95, 1.02, 1.05, 1.1, 1.15, 1.2, 1.3, 1.5)
_HEAD = ("te", "gamma", "onset", "the march's", "over it", *(f"{past:g}" for past in _PAST), "what the run says")


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    sheet = Sheet("dehydration-nearly", _HEAD, "dehydration")
    for te, gamma in _FRUITS:
        params = SOLVER.parse({"te": te, "gamma": gamma, "mirrors": "xyz"})
        assert isinstance(params, DehydrationParams)
        settings = choose(params, "preview", 0.1)
        begins, ends = (onset(params, kappa_ratio=k).s_cr for k in (settings.kappa_ratio, settings.march_kappa_ratio))
        assert begins is not None
        assert ends is not None
        need = Need(stages=tuple(round(begins * past, 5) for past in _PAST), quality="preview", fields=("roughness",))
        run = SOLVER.solve(params, SOLVER.settle(need, of=(params,)))
        rough = (run["roughness"].values / te).tolist()
        sheet.add(
            (f"{te:g}", gamma, f"{begins:.4f}", f"{ends:.4f}", f"{ends / begins - 1:+.0%}",
             *(f"{value:.2f}" for value in rough), run.attrs.get("note", "").partition(":")[0]),
            te=te, gamma=gamma, onset=begins, march=ends, past=list(_PAST), roughness=rough,
            note=run.attrs.get("note"), converged=run["converged"].values.tolist(),
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main()
