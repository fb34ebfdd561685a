"""Scaled masses that follow the deformation, so that a unit step stays below every element's limit.

An element that is stretched sideways grows the faces its volume depends on, and its stiffness with their square: in the
flesh under deep folds (gamma = 50, s = 0.3) 5 times the fresh one. Masses carry no physics here, only equilibria do.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from solver.dehydration.kernel.bounds import element_bounds, nodal_sums
from solver.dehydration.kernel.layout import Layout

from ...arrays import Bools, Floats, Ints32

LEAST_VOLUME = 0.05
"""Elements whose corner Jacobian falls below this share of the largest keep their fresh bound: it has no inverse."""


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
    mass = nodal_sums(layout.connectivity, safety * bound / 4, layout.nodes)
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
    least_share = -np.inf if even_crushed else LEAST_VOLUME
    return element_bounds(state, layout.connectivity, is_exocarp, mu, kappa, least_share)
