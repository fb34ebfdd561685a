"""How far hexahedra are from being turned inside out, by the Jacobians at their corners."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from ...contract import InvalidGeometry

__all__ = ["corner_ratios", "right_side_out"]


@njit(cache=True, error_model="numpy", nogil=True)
def corner_ratios(positions: Floats, connectivity: Ints) -> Floats:
    """Return least over largest corner Jacobian of each element, (ne,): 1 for a brick, not positive if inverted.

    positions (nn, 3), connectivity (ne, 8) with bits xi = 4, eta = 2, zeta = 1.
    """
    ratios, x, edge = np.empty(len(connectivity)), np.empty((8, 3)), np.empty((3, 3))
    for e in range(len(connectivity)):
        for c in range(8):
            for k in range(3):
                x[c, k] = positions[connectivity[e, c], k]
        least, largest = np.inf, 0.0
        for c in range(8):
            for axis in range(3):
                # the neighbour along each axis differs in one bit; the sign turns the edge to point along the axis
                bit = 4 >> axis
                sign = -1.0 if c & bit else 1.0
                for k in range(3):
                    edge[axis, k] = (x[c ^ bit, k] - x[c, k]) * sign
            jacobian = (
                (edge[0, 1] * edge[1, 2] - edge[0, 2] * edge[1, 1]) * edge[2, 0]
                + (edge[0, 2] * edge[1, 0] - edge[0, 0] * edge[1, 2]) * edge[2, 1]
                + (edge[0, 0] * edge[1, 1] - edge[0, 1] * edge[1, 0]) * edge[2, 2]
            )
            least, largest = min(least, jacobian), max(largest, abs(jacobian))
        ratios[e] = least / largest
    return ratios


def right_side_out(positions: Floats, connectivity: Ints) -> float:
    """Return the least of `corner_ratios`.

    Raises:
        InvalidGeometry: it is not positive.

    """
    worst = float(corner_ratios(positions, connectivity).min())
    if not worst > 0:
        raise InvalidGeometry(
            f"the mesh turns inside out (corner Jacobians of one element differ by the factor {worst:.3g}).",
            advice="Bring r2..r8 closer to each other, make the stone rounder, or ask for a finer quality.",
        )
    return worst
