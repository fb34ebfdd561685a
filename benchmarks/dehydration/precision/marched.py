"""Whole dehydration runs before and after: python -m benchmarks.dehydration.precision.marched BEFORE [--rounds 3].

BEFORE is a checkout to compare with; how is said in `benchmarks.turns`. Preview, gamma 10 but where it says so; what is
compared are all variables of the results but the seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

#: As in `benchmarks.turns`, which the tree before need not have.
Use = Callable[[], list[np.ndarray]]


def _run(stages: tuple[float, ...], **words: Any) -> Use:
    from solver.contract import Need
    from solver.dehydration import SOLVER

    params, need = SOLVER.parse(words, "sphere"), Need(stages=stages, quality="preview", resolution=16)

    def use() -> list[np.ndarray]:
        found = SOLVER.solve(params, need)
        return [found[name].values for name in sorted({*map(str, found.variables)} - {"seconds", "displacement"})] + [
            found["displacement"].values
        ]

    return use


def eighth() -> Use:
    """An eighth at te .04 to s = .3, which folds."""
    return _run((0.1, 0.15, 0.2, 0.3), te=0.04, gamma=10.0, mirrors="xyz")


def thick() -> Use:
    """A whole fruit at te .1 and gamma 3 to s = .1: smooth."""
    return _run((0.05, 0.1), te=0.1, gamma=3.0)


def whole() -> Use:
    """A whole fruit at te .04 to s = .1: dimples, hardly touching."""
    return _run((0.1,), te=0.04, gamma=10.0)


def folded() -> Use:
    """A whole fruit at te .04 to s = .2, which folds."""
    return _run((0.2,), te=0.04, gamma=10.0)


def thin() -> Use:
    """An eighth at te .02 to s = .3, which folds much."""
    return _run((0.1, 0.15, 0.2, 0.3), te=0.02, gamma=10.0, mirrors="xyz")


USES = (eighth, thick, whole, folded, thin)


if __name__ == "__main__":
    from benchmarks.turns import main

    main("dehydration-marched", __file__, __doc__, USES)
