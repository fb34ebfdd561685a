"""Which fruits of a heap can meet, and the planes in which they do.

Two bodies that give way alike meet in a plane between them. Its normal is that of the way between their middles; where
along it the plane lies is no choice: at the place where both push it alike, so that action equals reaction. Each side
pushes by a one-sided quadratic penalty of how far its points are beyond the plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Floats, Ints

__all__ = ["Pairs", "paired", "planes"]

#: Bodies whose surfaces are farther apart than this do not meet before the next look [r1].
_REACH = 0.6


class Pairs(NamedTuple):
    """Pairs of bodies: numbers (c, 2), and unit ways (c, 3) from the first to the second."""

    body: Ints
    way: Floats


def paired(skins: Floats) -> Pairs:
    """Return which bodies may meet; skins: points of their surfaces (b, s, 3)."""
    middle = skins.mean(axis=1)
    reach = np.linalg.norm(skins - middle[:, None], axis=2).max(axis=1)
    first, second = np.triu_indices(len(skins), 1)
    away = middle[second] - middle[first]
    far = np.linalg.norm(away, axis=1)
    near = far < reach[first] + reach[second] + _REACH
    first, second, away, far = first[near], second[near], away[near], far[near]
    return Pairs(np.stack([first, second], axis=1), away / np.maximum(far, 1e-300)[:, None])


@njit(cache=True)
def planes(
    ahead: Floats, behind: Floats, stiff: Floats, first: Ints, second: Ints, place: Floats, push: Floats
) -> None:
    """Write where along their ways planes are pushed alike from both sides (c), and how hard (c).

    ahead (c, s): heights along the way of the first bodies' points, behind (c, s): of the second ones'; stiff (b, s):
    stiffness of their points; first, second (c): the bodies. Bodies that do not overlap meet midway, without a push.
    """
    for c in range(len(ahead)):
        high, low = ahead[c].max(), behind[c].min()
        if high <= low:
            place[c], push[c] = (high + low) / 2, 0.0
            continue
        # the difference of the pushes falls evenly between corners: Newton's steps within a bracket end exactly
        p = (high + low) / 2
        for _ in range(60):
            pull = slope = one = 0.0
            for i in range(ahead.shape[1]):
                if ahead[c, i] > p:
                    one += stiff[first[c], i] * (ahead[c, i] - p)
                    slope += stiff[first[c], i]
                if behind[c, i] < p:
                    pull += stiff[second[c], i] * (p - behind[c, i])
                    slope += stiff[second[c], i]
            if one > pull:
                low = p
            else:
                high = p
            then = p + (one - pull) / slope
            if not low <= then <= high:
                then = (low + high) / 2
            if abs(then - p) <= 1e-15 * (1 + abs(p)):
                break
            p = then
        place[c], push[c] = p, (one + pull) / 2
