"""Masses of a thin skin: its columns of nodes are light where they move as one and heavy where they part.

A skin's element is stiffest across its thickness. With masses of nodes (see `masses`) all its motion is as heavy as
that wants it, bending too, which is what settles last. So an element's mass is another one for c = (t + b) / sqrt 2 of
the two ends of its edges across the thickness than for r = (t - b) / sqrt 2 (selective mass scaling, Olovsson,
Simonsson and Unosson 2005). As K is positive, for any e

    K <= (1 + e) K_cc + (1 + 1/e) K_rr,

and a unit step is stable with 4 m_c = (1 + e) lambda_max(K_cc) and 4 m_r = (1 + 1/e) lambda_max(K_rr). Of an element of
thickness t and edges h the first goes with t, the second, and the mass of nodes, with h^2 / t.

The three nodes of a column then share a 3 x 3 mass matrix, tridiagonal and the same for x, y and z. Its inverse works
on their forces before nodes are moved by what stands on its diagonal: row i becomes sum_j A_ij f_j with
A_ij = M^-1_ij / M^-1_ii.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import njit

from solver.dehydration.kernel.bounds import nodal_sums
from solver.dehydration.kernel.strips import BOTTOM, GROUP, TOP

from ...arrays import Bools, Floats, Ints, Ints32, Singles

if TYPE_CHECKING:
    from solver.dehydration.kernel.layout import Layout

__all__ = ["Weights", "are_alike", "columns_of", "held_outside", "mix", "momentum", "pays", "weights"]

OPTIONS: Any = {"error_model": "numpy", "forceinline": True}
"""No cache of their own: see `skin`."""

#: 1 + e and 1 + 1/e. Split bounds are loose: the highest frequency of fresh fruits (te 0.02 and 0.04) is 1.1 of the 2
#: that are stable, where with masses of nodes it is 1.34. Nothing is taken off for that: with 0.7 of these masses
#: skin that touches chattered under deep folds and did not balance in 1 of 10 runs.
COMMON, RELATIVE = 1.5, 3.0

#: Masses of nodes over those of columns that move as one, from which columns share theirs. At te = 0.1 it is 1.2.
_PAYS = 1.5


class Weights(NamedTuple):
    """Scaled masses, as in `Layout`."""

    mass: Floats
    inverse_mass: Singles
    pull: Floats
    spread: Singles


def columns_of(connectivity: Ints, is_exocarp: Bools) -> Ints:
    """Outer nodes of a skin's columns if those are of three nodes in a row each, else none."""
    low, high = connectivity[is_exocarp][:, BOTTOM].ravel(), connectivity[is_exocarp][:, TOP].ravel()
    outer = np.setdiff1d(high, low)
    inner = np.setdiff1d(low, high)
    if np.array_equal(high, low + 1) and np.array_equal(outer, inner + 2):
        return outer
    return outer[:0]


def pays(bounds: Floats, is_exocarp: Bools) -> bool:
    """Whether a skin's columns are to share their masses; bounds (3, ne) as of `reweigh.stiffness_bounds`, fresh."""
    whole, common, _ = bounds[:, is_exocarp]
    return bool(is_exocarp.any() and np.median(whole / (COMMON * common)) > _PAYS)


def weights(connectivity: Ints, is_exocarp: Bools, held: Bools, tops: Ints32, bounds: Floats, safety: float) -> Weights:
    """Scaled masses for bounds (3, ne) of elements: on the whole, moving as one, parting; the last two of a skin that
    has `tops`, the outer nodes of its columns, whose other two come before them.
    """
    nodes = len(held)
    if not len(tops):
        mass = nodal_sums(connectivity, safety * bounds[0] / 4, nodes)
        return Weights(mass, _inverse(mass, held), np.zeros(0), np.zeros((0, 6), np.float32))
    common, relative = safety / 4 * COMMON * bounds[1], safety / 4 * RELATIVE * bounds[2]
    own = np.where(is_exocarp, (common + relative) / 2, safety * bounds[0] / 4)
    mass = nodal_sums(connectivity, own, nodes)
    edges, shared = connectivity[is_exocarp][:, BOTTOM], ((common - relative) / 2)[is_exocarp]
    pull = np.bincount(edges.ravel(), np.repeat(shared, len(BOTTOM)), nodes).astype(np.float64, copy=False)
    inverse, spread = _inverse(mass, held), np.zeros((len(tops), 6), np.float32)
    a, b, c, p, q = mass[tops - 2], mass[tops - 1], mass[tops], pull[tops - 2], pull[tops - 1]
    # the inverse times its determinant
    low, middle, top = b * c - q * q, a * c, a * b - p * p
    both = p * q
    for k, (value, diagonal) in enumerate(
        ((-p * c, low), (both, low), (-p * c, middle), (-a * q, middle), (both, top), (-a * q, top))
    ):
        spread[:, k] = value / diagonal
    determinant = a * low - p * p * c
    for node, entry in ((tops - 2, low), (tops - 1, middle), (tops, top)):
        inverse[node] = entry / determinant
    return Weights(mass, inverse, pull, spread)


def _inverse(mass: Floats, held: Bools) -> Singles:
    inverse = np.zeros(mass.shape, np.float32)
    moving = ~held & (mass > 0)
    inverse[moving] = 1 / mass[moving]
    return inverse


def held_outside(layout: Layout, surface: Ints) -> Layout:
    """`layout` with the nodes `surface` held, the tops of all columns if it has any."""
    inverse = layout.inverse_mass.copy()
    inverse[surface] = 0
    if not len(layout.tops):
        return dataclasses.replace(layout, inverse_mass=inverse)
    low, middle = layout.tops - 2, layout.tops - 1
    a, b, p = layout.mass[low], layout.mass[middle], layout.pull[low]
    spread = np.zeros_like(layout.spread)
    spread[:, 0], spread[:, 2] = -p / b, -p / a
    determinant = a * b - p * p
    inverse[low], inverse[middle] = b / determinant, a / determinant
    return dataclasses.replace(layout, inverse_mass=inverse, spread=spread)


def momentum(layout: Layout, velocity: Singles) -> Floats:
    """Scaled masses times velocity (nodes, 3 or 4), (nodes, 3); of fixed nodes as well."""
    speed = velocity[:, :3].astype(np.float64)
    found: Floats = layout.mass[:, None] * speed
    if len(layout.pull):
        pull = layout.pull[:-1, None]
        found[:-1] += pull * speed[1:]
        found[1:] += pull * speed[:-1]
    return found


@njit(**OPTIONS)
def _total(forces: Singles, row_start: Ints32, rows: Ints32, node: int) -> Any:
    """Sum of a node's force rows."""
    x = y = z = np.float32(0)
    for entry in range(row_start[node], row_start[node + 1]):
        row = rows[entry]
        x += forces[row]
        y += forces[row + 1]
        z += forces[row + 2]
    return x, y, z


@njit(**OPTIONS)
def are_alike(row_start: Ints32, tops: Ints32, place: int) -> bool:
    """Whether each node of a column has GROUP force rows: nodes of a column have as many as each other."""
    top = np.int64(tops[place])
    return bool(row_start[top + 1] - row_start[top - 2] == 3 * GROUP)


@njit(**OPTIONS)
def mix(forces: Singles, row_start: Ints32, rows: Ints32, tops: Ints32, spread: Singles, place: int) -> None:
    """Add to a column's force rows what makes their sums A f (see the module's head)."""
    top = np.int64(tops[place])
    x0, y0, z0 = _total(forces, row_start, rows, top - 2)
    x1, y1, z1 = _total(forces, row_start, rows, top - 1)
    x2, y2, z2 = _total(forces, row_start, rows, top)
    low, middle, last = rows[row_start[top - 2]], rows[row_start[top - 1]], rows[row_start[top]]
    a, b = spread[place, 0], spread[place, 1]
    forces[low] += a * x1 + b * x2
    forces[low + 1] += a * y1 + b * y2
    forces[low + 2] += a * z1 + b * z2
    a, b = spread[place, 2], spread[place, 3]
    forces[middle] += a * x0 + b * x2
    forces[middle + 1] += a * y0 + b * y2
    forces[middle + 2] += a * z0 + b * z2
    a, b = spread[place, 4], spread[place, 5]
    forces[last] += a * x0 + b * x1
    forces[last + 1] += a * y0 + b * y1
    forces[last + 2] += a * z0 + b * z1
