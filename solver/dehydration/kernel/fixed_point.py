"""Positions as 32-bit fixed point.

A float32 near 1 resolves 6e-8; with a bulk modulus of 100 shear moduli and elements of 0.03 that alone is a residual
of 1e-2 of the internal force, and every step adds its rounding. Integers of 2^-29 resolve 32 times finer over the same
range of all coordinates, take no more memory, and their differences, all that an element needs, are exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Floats, Ints32

QUANTUM = 2.0**-29
"""Length of one unit of the state, in units of r1."""
REACH = 3.9
"""Largest coordinate that leaves room for a fruit to move within +-4."""


def positions(state: Ints32) -> Floats:
    """State (nn, 4) int32 -> positions (nn, 3) float64."""
    return state[:, :3].astype(np.float64) * QUANTUM


def place(state: Ints32, where: ArrayLike) -> None:
    """Set the state (nn, 4) to positions (nn, 3), rounded to the nearest unit. ValueError beyond `REACH`."""
    coordinates = np.asarray(where, dtype=np.float64)
    if not np.all(np.abs(coordinates) <= REACH):
        raise ValueError(f"positions must be finite and within +-{REACH}; use a unit of length near the fruit's size")
    state[:, :3] = np.rint(coordinates / QUANTUM)


def out_of_reach(state: Ints32) -> bool:
    """Whether a run has blown up: some coordinate ran to the edge of the range."""
    return bool(np.abs(state[:, :3].astype(np.int64)).max() * QUANTUM > REACH)
