"""What past moves teach of an energy's curvature: both loops of L-BFGS (Nocedal 1980), in place."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Floats, Singles

__all__ = ["Move", "direction", "moved"]


class Move(NamedTuple):
    """A move (v, 3), the change of the slope along it (v, 3), both single, and the product of the two.

    They only teach a direction, which is checked: half the bytes are half the time, and no digit of a result.
    """

    way: Singles
    change: Singles
    product: float


def moved(way: Floats, change: Floats) -> Move:
    """Return what is kept of a move (v, 3) and of the change of the slope (v, 3)."""
    kept = way.astype(np.float32), change.astype(np.float32)
    return Move(*kept, float(_product(*kept)))


def direction(slope: Floats, apply: Callable[[Floats], Floats], moves: tuple[Move, ...]) -> Floats:
    """Return the direction (v, 3) of L-BFGS that starts from an inverse in place of a multiple of one.

    The tangent leaves compression out: alone it is too stiff for buckles, which past moves teach it.
    apply: the inverse.
    """
    # a move along which the energy curves down teaches nothing
    kept = [move for move in moves if move.product > 0]
    q, parts = -slope, []
    for s, y, product in reversed(kept):
        part = _product(s, q) / product
        parts.append(part)
        _add(q, -part, y)
    d = apply(q)
    for (s, y, product), part in zip(kept, reversed(parts), strict=True):
        _add(d, part - _product(y, d) / product, s)
    return d if _product(slope, d) < 0 else -slope


@njit(cache=True, fastmath={"reassoc", "contract"}, error_model="numpy")
def _product(a: Floats | Singles, b: Floats | Singles) -> float:
    # no BLAS, whose sums depend on its threads
    x, y = a.reshape(-1), b.reshape(-1)
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _add(to: Floats, share: float, what: Singles) -> None:
    """Add a share of `what` (v, 3) to `to` (v, 3)."""
    sums, more = to.reshape(-1), what.reshape(-1)
    for i in range(sums.size):
        sums[i] += share * more[i]
