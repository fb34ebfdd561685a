"""The bound of `masses`, compiled: it is taken of every element many times in a run, as masses follow the deformation.

`masses.largest_stiffness` is its plain twin; the loops here are over one element's 36 distinct entries of L.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from ...arrays import Bools, Floats, Ints, Ints32
from .fixed_point import QUANTUM
from .metric import SLOPES, quadrature

__all__ = ["element_bounds", "nodal_sums"]


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


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "nsz", "arcp", "contract"})
def _stiffness(x: Floats, slopes: Floats, weights: Floats, g: Floats, b: Floats, l: Floats) -> float:  # noqa: E741
    """Volume of an element with corners x (8, 3); adds its gradient to b (8, 3), and L to l (8, 8). g (8, 3): room."""
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
            g[a, 0] = s * i00 + t * i01 + u * i02
            g[a, 1] = s * i10 + t * i11 + u * i12
            g[a, 2] = s * i20 + t * i21 + u * i22
        for a in range(8):
            for k in range(3):
                b[a, k] += v * g[a, k]
            for c in range(a, 8):
                l[a, c] += v * (g[a, 0] * g[c, 0] + g[a, 1] * g[c, 1] + g[a, 2] * g[c, 2])
    for a in range(8):
        for c in range(a):
            l[a, c] = l[c, a]
    return volume


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "nsz", "arcp", "contract"})
def _largest(l: Floats, b: Floats, volume: float, mu: float, kappa: float) -> float:  # noqa: E741
    """The bound for scalar stiffness l (k, k) and volume gradient b (k, 3)."""
    count = len(l)
    squared = norm = along = 0.0
    for a in range(count):
        for c in range(a, count):
            entry = 0.0
            for k in range(count):
                entry += l[a, k] * l[c, k]
            squared += entry * entry if c == a else 2.0 * entry * entry
        for k in range(3):
            entry = 0.0
            for c in range(count):
                entry += l[a, c] * b[c, k]
            along += b[a, k] * entry
            norm += b[a, k] * b[a, k]
    shear = 2.0 * mu * math.sqrt(math.sqrt(squared))
    bulk = kappa * norm / volume
    total = bulk + 2.0 * mu * along / norm + shear
    return 0.5 * (total + math.sqrt(max(total * total - 4.0 * bulk * shear, 0.0)))


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "nsz", "arcp", "contract"})
def _half(l: Floats, b: Floats, sign: float, part: Floats, slope: Floats) -> None:  # noqa: E741
    """Fill `part` (4, 4) and `slope` (4, 3), what l and b are of (t + sign b) / sqrt 2 of the ends of zeta's edges."""
    for a in range(4):
        for c in range(4):
            across = l[2 * a, 2 * c + 1] + l[2 * a + 1, 2 * c]
            part[a, c] = 0.5 * (l[2 * a, 2 * c] + l[2 * a + 1, 2 * c + 1] + sign * across)
        for i in range(3):
            slope[a, i] = math.sqrt(0.5) * (b[2 * a + 1, i] + sign * b[2 * a, i])


@njit(cache=True, error_model="numpy", parallel=True, fastmath={"reassoc", "nsz", "arcp", "contract"})
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
    for place in prange(elements.size):
        e = elements[place]
        x, b, g, l = np.empty((8, 3)), np.zeros((8, 3)), np.empty((8, 3)), np.zeros((8, 8))  # noqa: E741
        for a in range(8):
            for i in range(3):
                x[a, i] = state[connectivity[e, a], i] * QUANTUM
        if not _sound(x, least_share):
            continue
        volume = _stiffness(x, slopes, weights, g, b, l)
        bounds[0, e] = _largest(l, b, volume, mu[e], kappa[e])
        if split:
            part, slope = np.empty((4, 4)), np.empty((4, 3))
            for k in range(2):
                _half(l, b, 1.0 - 2.0 * k, part, slope)
                bounds[1 + k, e] = _largest(part, slope, volume, mu[e], kappa[e])


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
