"""The state of what decays: rot and mould, the water that has gone, and since when the skin is rotten."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ..within.roast import Roasted
from .layer import State

__all__ = ["ROTTEN", "Both", "rotten_since"]

#: Map value from which a place counts as rotten.
ROTTEN = 0.1


class Both(NamedTuple):
    """State of the rot, of the mould if there is one, and the water that has evaporated, over the fresh weight.

    wet (n): of flesh with fields of its own, its water over the fresh one's, skin first. roasted: what an oven made of
    it. since (v): the day on which the skin was rotten first, infinite where it is not; None is nowhere.
    """

    rot: State
    mould: State | None
    water: float = 0.0
    wet: Floats | None = None
    roasted: Roasted | None = None
    since: Floats | None = None


def rotten_since(before: Floats, after: Floats, known: Floats | None, day: float, dt: float) -> Floats | None:
    """Return since when the skin is rotten, after a step of dt from a day on: it became so evenly within it [day].

    before, after: the map of rot (v) as the step starts and ends; known: since when it was as the step starts.
    """
    newly = (after >= ROTTEN) if known is None else (after >= ROTTEN) & np.isinf(known)
    if not newly.any():
        return known
    since = np.full(len(after), np.inf) if known is None else known.copy()
    rise = np.maximum(after - before, 1e-300)
    since[newly] = day + dt * np.clip((ROTTEN - before) / rise, 0.0, 1.0)[newly]
    return since
