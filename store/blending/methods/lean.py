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
    steep = np.multiply.outer(weights, 1 + _STEEPER * (1 - alike))
    falling = -np.sort(-steep, axis=0)
    count = np.arange(1, len(weights) + 1)[:, None]
    over = (np.cumsum(falling, axis=0) - 1) / count
    # the last one that is above what is taken off all
    last = (falling > over).sum(axis=0) - 1
    found: Array = np.maximum(steep - over[last, np.arange(len(alike))], 0)
    return found
