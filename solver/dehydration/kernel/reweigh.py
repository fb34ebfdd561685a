"""Scaled masses that follow the deformation, so that a unit step stays below every element's limit.

An element that is stretched sideways grows the faces its volume depends on, and its stiffness with their square: in the
flesh under deep folds (gamma = 50, s = 0.3) 5 times the fresh one. Masses carry no physics here, only equilibria do.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from solver.dehydration.kernel.bounds import element_bounds
from solver.dehydration.kernel.coupled import weights
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

    is_exocarp, mu, kappa (ne,): as given to `build_layout`. fresh_bound (3, ne): `stiffness_bounds` at the fresh state,
    below which no element's bound falls.
    """
    bounds = np.maximum(fresh_bound, stiffness_bounds(layout, state, is_exocarp, mu, kappa))
    found = weights(layout.connectivity, is_exocarp, ~layout.free, layout.tops, bounds, safety)
    return dataclasses.replace(layout, **found._asdict())


def stiffness_bounds(
    layout: Layout,
    state: Ints32,
    is_exocarp: Bools,
    mu: Floats,
    kappa: Floats,
    *,
    even_crushed: bool = False,
) -> Floats:
    """Upper bounds (3, ne) of each element's largest stiffness at `state`; 0 for elements too crushed to have one.

    First on the whole, then, where the layout's columns share their masses, of the skin's motion as one and of its
    parting (see `coupled`). even_crushed: take it of those as well, as for a fresh mesh, which has slender but no
    inverted ones.
    """
    least = -np.inf if even_crushed else LEAST_VOLUME
    return element_bounds(state, layout.connectivity, is_exocarp, mu, kappa, least, split=len(layout.tops) > 0)
