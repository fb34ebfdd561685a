"""Scaled masses that follow the deformation, so that a unit step stays below every element's limit.

An element that is stretched sideways grows the faces its volume depends on, and its stiffness with their square: in the
flesh under deep folds (gamma = 50, s = 0.3) 5 times the fresh one. Masses carry no physics here, only equilibria do.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from solver.dehydration.kernel.fixed_point import positions
from solver.dehydration.kernel.layout import Layout
from solver.dehydration.kernel.masses import largest_stiffness

from ...arrays import Bools, Floats, Ints32

LEAST_VOLUME = 0.05
"""Elements whose corner Jacobian falls below this share of the largest keep their fresh bound: it has no inverse."""


def _sound(corners: Floats) -> Bools:
    """Whether the Jacobians at all corners of each element (ne, 8, 3) are clearly positive."""
    jacobians = np.empty(corners.shape[:2])
    for c in range(8):
        # the neighbour along each axis differs in one bit; the sign turns the edge to point along the axis
        edges = [(corners[:, c ^ bit] - corners[:, c]) * (1 if not c & bit else -1) for bit in (4, 2, 1)]
        jacobians[:, c] = np.einsum("ei,ei->e", np.cross(edges[0], edges[1]), edges[2])
    sound: Bools = jacobians.min(axis=1) > LEAST_VOLUME * jacobians.max(axis=1)
    return sound


def reweigh(
    layout: Layout,
    state: Ints32,
    is_exocarp: Bools,
    mu: Floats,
    kappa: Floats,
    fresh_bound: Floats,
    *,
    safety: float = 1.5,
) -> Layout:
    """The layout with masses for the elements as they are at `state` (nodes, 4).

    is_exocarp, mu, kappa (ne,): as given to `build_layout`. fresh_bound (ne,): `stiffness_bounds` at the fresh state,
    below which no element's bound falls.
    """
    bound = np.maximum(fresh_bound, stiffness_bounds(layout, state, is_exocarp, mu, kappa))
    shares = np.repeat(safety * bound / 4, 8)
    total = np.bincount(layout.connectivity.ravel(), weights=shares, minlength=layout.nodes)
    mass: Floats = np.asarray(total, np.float64)
    inverse = np.zeros(layout.nodes, np.float32)
    inverse[layout.free] = 1 / mass[layout.free]
    return dataclasses.replace(layout, mass=mass, inverse_mass=inverse)


def stiffness_bounds(
    layout: Layout,
    state: Ints32,
    is_exocarp: Bools,
    mu: Floats,
    kappa: Floats,
    *,
    even_crushed: bool = False,
) -> Floats:
    """Upper bound (ne,) of each element's largest stiffness at `state`; 0 for elements too crushed to have one.

    even_crushed: take it of those as well, as for a fresh mesh, which has slender but no inverted ones.
    """
    corners = positions(state)[layout.connectivity]
    sound = np.ones(len(corners), bool) if even_crushed else _sound(corners)
    bound = np.zeros(layout.elements)
    for exocarp in (False, True):
        chosen = (is_exocarp == exocarp) & sound
        if chosen.any():
            bound[chosen] = largest_stiffness(corners[chosen], mu[chosen], kappa[chosen], exocarp, one_point=False)
    return bound
