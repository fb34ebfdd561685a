"""The bound of `masses`, compiled: it is taken of every element many times in a run, as masses follow the deformation.

`masses.largest_stiffness` is its plain twin. No sum may be reordered here: numba optimises a parallel loop once more
before it keeps it, and the first process would have other last bits than those that load what it compiled.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from ...arrays import Bools, Floats, Ints, Ints32
from .fixed_point import QUANTUM
from .metric import SLOPES, quadrature

__all__ = ["element_bounds", "nodal_sums"]


#: Parts of the elements, each with room of its own.
_PARTS = 64


@njit(cache=True, error_model="numpy")
def _sound(x: Floats, least_share: float) -> bool:
    """Whether the Jacobians at all corners of an element (8, 3) are clearly positive.

    The neighbour along each axis differs in one bit; the sign turns the edges to point along the axes.
    """
    least, most = math.inf, -math.inf
    for c in range(8):
        sign = -1.0 if ((c >> 2) + (c >> 1) + c) & 1 else 1.0
        a, b, d = c ^ 4, c ^ 2, c ^ 1
        ux, uy, uz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
        vx, vy, vz = x[b, 0] - x[c, 0], x[b, 1] - x[c, 1], x[b, 2] - x[c, 2]
        wx, wy, wz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
        volume = (uy * vz - uz * vy) * wx + (uz * vx - ux * vz) * wy + (ux * vy - uy * vx) * wz
        least, most = min(least, sign * volume), max(most, sign * volume)
    return least > least_share * most


@njit(cache=True, error_model="numpy")
def _stiffness(x: Floats, slopes: Floats, weights: Floats, g: Floats, b: Floats, l: Floats) -> float:  # noqa: E741
    """Volume of an element with corners x (8, 3); adds its gradient to b (8, 3), and L to l (8, 8). g (3, 8): room."""
    volume = 0.0
    for q in range(weights.size):
        j00 = j01 = j02 = j10 = j11 = j12 = j20 = j21 = j22 = 0.0
        for a in range(8):
            s, t, u = slopes[q, a, 0], slopes[q, a, 1], slopes[q, a, 2]
            j00, j01, j02 = j00 + x[a, 0] * s, j01 + x[a, 0] * t, j02 + x[a, 0] * u
            j10, j11, j12 = j10 + x[a, 1] * s, j11 + x[a, 1] * t, j12 + x[a, 1] * u
            j20, j21, j22 = j20 + x[a, 2] * s, j21 + x[a, 2] * t, j22 + x[a, 2] * u
        c00, c01, c02 = j11 * j22 - j12 * j21, j12 * j20 - j10 * j22, j10 * j21 - j11 * j20
        determinant = j00 * c00 + j01 * c01 + j02 * c02
        r = 1.0 / determinant
        i10, i11, i12 = (j02 * j21 - j01 * j22) * r, (j00 * j22 - j02 * j20) * r, (j01 * j20 - j00 * j21) * r
        i20, i21, i22 = (j01 * j12 - j02 * j11) * r, (j02 * j10 - j00 * j12) * r, (j00 * j11 - j01 * j10) * r
        i00, i01, i02 = c00 * r, c01 * r, c02 * r
        v = determinant * weights[q]
        volume += v
        for a in range(8):
            s, t, u = slopes[q, a, 0], slopes[q, a, 1], slopes[q, a, 2]
            g[0, a] = s * i00 + t * i01 + u * i02
            g[1, a] = s * i10 + t * i11 + u * i12
            g[2, a] = s * i20 + t * i21 + u * i22
        for a in range(8):
            g0, g1, g2 = v * g[0, a], v * g[1, a], v * g[2, a]
            b[a, 0], b[a, 1], b[a, 2] = b[a, 0] + g0, b[a, 1] + g1, b[a, 2] + g2
            # all of L, though it is symmetric: whole rows are the faster
            for c in range(8):
                l[a, c] += g0 * g[0, c] + g1 * g[1, c] + g2 * g[2, c]
    return volume


@njit(cache=True, error_model="numpy")
def _largest(l: Floats, b: Floats, volume: float, mu: float, kappa: float, row: Floats) -> float:  # noqa: E741
    """The bound for scalar stiffness l (k, k) and volume gradient b (k, 3). row (k,): room."""
    count = len(l)
    squared = norm = along = 0.0
    for a in range(count):
        row[:] = 0.0
        e0 = e1 = e2 = 0.0
        for k in range(count):
            entry = l[a, k]
            for c in range(count):
                row[c] += entry * l[k, c]
            e0, e1, e2 = e0 + entry * b[k, 0], e1 + entry * b[k, 1], e2 + entry * b[k, 2]
        for c in range(count):
            squared += row[c] * row[c]
        along += b[a, 0] * e0 + b[a, 1] * e1 + b[a, 2] * e2
        norm += b[a, 0] * b[a, 0] + b[a, 1] * b[a, 1] + b[a, 2] * b[a, 2]
    shear = 2.0 * mu * math.sqrt(math.sqrt(squared))
    bulk = kappa * norm / volume
    total = bulk + 2.0 * mu * along / norm + shear
    return 0.5 * (total + math.sqrt(max(total * total - 4.0 * bulk * shear, 0.0)))


@njit(cache=True, error_model="numpy")
def _half(l: Floats, b: Floats, sign: float, part: Floats, slope: Floats) -> None:  # noqa: E741
    """Fill `part` (4, 4) and `slope` (4, 3), what l and b are of (t + sign b) / sqrt 2 of the ends of zeta's edges."""
    for a in range(4):
        for c in range(4):
            across = l[2 * a, 2 * c + 1] + l[2 * a + 1, 2 * c]
            part[a, c] = 0.5 * (l[2 * a, 2 * c] + l[2 * a + 1, 2 * c + 1] + sign * across)
        for i in range(3):
            slope[a, i] = math.sqrt(0.5) * (b[2 * a + 1, i] + sign * b[2 * a, i])


@njit(cache=True, error_model="numpy", parallel=True)
def _bounds(
    state: Ints32,
    connectivity: Ints,
    elements: Ints,
    slopes: Floats,
    weights: Floats,
    mu: Floats,
    kappa: Floats,
    least_share: float,
    split: bool,
    bounds: Floats,
) -> None:
    """Fill bounds (3, ne) of `elements`, the last two if `split`; slopes (q, 8, 3): the rule's shape derivatives."""
    for part in prange(_PARTS):
        # arrays for each element would come from the heap, a tenth of the time
        x, b, g, l = np.empty((8, 3)), np.empty((8, 3)), np.empty((3, 8)), np.empty((8, 8))  # noqa: E741
        half, slope, row = np.empty((4, 4)), np.empty((4, 3)), np.empty(8)
        for place in range(part * elements.size // _PARTS, (part + 1) * elements.size // _PARTS):
            e = elements[place]
            for a in range(8):
                for i in range(3):
                    x[a, i] = state[connectivity[e, a], i] * QUANTUM
            if not _sound(x, least_share):
                continue
            b[:], l[:] = 0.0, 0.0
            volume = _stiffness(x, slopes, weights, g, b, l)
            bounds[0, e] = _largest(l, b, volume, mu[e], kappa[e], row)
            if split:
                for k in range(2):
                    _half(l, b, 1.0 - 2.0 * k, half, slope)
                    bounds[1 + k, e] = _largest(half, slope, volume, mu[e], kappa[e], row[:4])


def element_bounds(
    state: Ints32,
    connectivity: Ints,
    is_exocarp: Bools,
    mu: Floats,
    kappa: Floats,
    least_share: float,
    *,
    split: bool,
) -> Floats:
    """Upper bounds (3, ne) of each element's largest stiffness at `state` (nodes, 4): on the whole and, of a skin's
    elements where those are asked for by `split`, of motion as one of the ends of its edges along zeta, and of their
    parting.

    0 for elements of which a corner Jacobian falls below least_share of the largest (-inf: of none), and elsewhere.
    """
    bounds = np.zeros((3, len(connectivity)))
    for exocarp in (False, True):
        elements = np.flatnonzero(is_exocarp == exocarp)
        rule = SLOPES[exocarp], quadrature(exocarp)[1]
        _bounds(state, connectivity, elements, *rule, mu, kappa, least_share, split and exocarp, bounds)
    return bounds


@njit(cache=True, error_model="numpy")
def nodal_sums(connectivity: Ints, values: Floats, nodes: int) -> Floats:
    """Sum (nodes,) of what each element (ne,) gives to each of its corners, in the order of the elements."""
    total = np.zeros(nodes)
    for e in range(len(connectivity)):
        for a in range(8):
            total[connectivity[e, a]] += values[e]
    return total
