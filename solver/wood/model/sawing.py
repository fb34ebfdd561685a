"""Saw cuts through bonds and rods."""

from __future__ import annotations

import numpy as np

from ..params import Cut, WoodParams
from .arrays import Bonds, Rods
from .curves import held
from .gripping import within

__all__ = ["crossed", "sawn"]


def _through(first: np.ndarray, second: np.ndarray, box: Cut) -> np.ndarray:
    """Return whether segments (n, 3) to (n, 3) meet a box, which may be flat."""
    low, high = np.zeros(len(first)), np.ones(len(first))
    for c in range(3):
        d = second[:, c] - first[:, c]
        flat = d == 0
        safe = np.where(flat, 1.0, d)
        p, q = (box.low[c] - first[:, c]) / safe, (box.high[c] - first[:, c]) / safe
        within = (first[:, c] >= box.low[c]) & (first[:, c] <= box.high[c])
        low = np.where(flat, np.where(within, low, np.inf), np.maximum(low, np.minimum(p, q)))
        high = np.where(flat, high, np.minimum(high, np.maximum(p, q)))
    return low <= high


def sawn(params: WoodParams, rest: np.ndarray, rods: Rods, bonds: Bonds) -> None:
    """Break the bonds that cuts go through; rest (v, 3) places at rest [m]."""
    if not len(bonds.i) or not params.cuts:
        return
    first = held(rest, rods, bonds.i, bonds.at)[0]
    second = held(rest, rods, bonds.j, bonds.share)[0]
    for cut in params.cuts:
        through = _through(first, second, cut)
        bonds.damage[through] = 1.0
        bonds.parted[through] = 1.0
        bonds.on[through] = 2


def crossed(params: WoodParams, rest: np.ndarray, rods: Rods) -> tuple[np.ndarray, np.ndarray]:
    """Return which edges (e,) bool the middles of cuts part, and where (e,), 0 to 1."""
    a, b = rest[rods.a], rest[rods.b]
    hit, place = np.zeros(len(a), bool), np.zeros(len(a))
    for cut in params.cuts:
        middle = (cut.low[0] + cut.high[0]) / 2
        share = (middle - a[:, 0]) / (b[:, 0] - a[:, 0])
        point = a + share[:, None] * (b - a)
        mine = (share >= 0) & (share < 1) & within(point, cut) & (rods.k > 0) & ~hit
        hit |= mine
        place[mine] = share[mine]
    return hit, place
