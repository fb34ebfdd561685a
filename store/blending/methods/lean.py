"""lean: as `thin`, but where neighbours do not share their pattern the answer leans to the nearest of them.

A mean of patterns that have nothing in common is no equilibrium of anything, whatever power is given back to it; each
pattern by itself nearly is one. So weights are multiplied, the more the less the samples are alike, and the nearest
weights that are none of them negative and sum to 1 are taken instead (a projection on a simplex). Over most of the
way from one sample to the next only one of them is left, and they take turns in the rest of it. Projections bring
no two points farther apart: nothing jumps, and no weight changes faster than by the factor.
"""

from __future__ import annotations

import numpy as np

from solver.arrays import Array

__all__ = ["leaning"]

#: By how much faster than linear ones weights change where samples have nothing in common, less 1. Chosen on the family
#: prolate, by how far the solver moves what is looked up (record dehydration-score): half as much moved it farther. The
#: runs held out of the default family had no part in it.
_STEEPER = 4.0


def leaning(weights: Array, alike: Array) -> Array:
    """Return the weights (samples, stages) to which `weights` (samples,), which sum to 1, lean where samples are
    `alike` (stages,) by no more than that: from 0, nothing, to 1, for which they stay as they are.
    """
    of = {a: _projected([w * (1 + _STEEPER * (1 - a)) for w in weights.tolist()]) for a in {*alike.tolist()}}
    return np.array([of[a] for a in alike.tolist()]).reshape(len(alike), len(weights)).T


def _projected(steep: list[float]) -> list[float]:
    """Return the nearest weights that are none of them negative and sum to 1."""
    # one by one: so few numbers take longer as arrays
    falling, over = 0.0, 0.0
    for count, weight in enumerate(sorted(steep, reverse=True), 1):
        falling += weight
        # what is taken off all: that of the last one that is above it
        most = (falling - 1) / count
        over = most if weight > most else over
    return [max(weight - over, 0.0) for weight in steep]
