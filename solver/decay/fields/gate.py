"""Where the mould may spread: only where rot is (D14).

The gate is 0 where the rot map is below 0.002 and 1 above 0.02, smoothly between. Rot's front passes through that in
less than a triangle, so an edge takes the gate of the rot at its middle: a mean of its ends' gates would shut it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats

__all__ = ["SHUT", "gate", "gates"]


#: Rot map where the gate starts to open and where it is open; below the first the mould does not enter. Ten times more
#: makes young colonies hang on how thin their rot is, and errors of the mesh four times larger.
SHUT = 0.002
_OPEN = 0.02


@njit(cache=True)
def gate(rot: float) -> float:
    """Return how open the gate is, 0 to 1, at a value of the rot map."""
    x = min(max((rot - SHUT) / (_OPEN - SHUT), 0.0), 1.0)
    return x * x * (3 - 2 * x)


@njit(cache=True)
def gates(rot: Floats) -> Floats:
    """Return the gate at the values of a rot map (v)."""
    found = np.empty_like(rot)
    for i in range(len(rot)):
        found[i] = gate(rot[i])
    return found
