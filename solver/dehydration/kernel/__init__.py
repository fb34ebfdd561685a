"""Explicit dynamics of nearly incompressible neo-Hookean hex8 elements with mean dilatation (Q1/P0).

`build_layout` prepares a mesh, `new_state` its state, `march` steps it. `internal_force`, `element_report`,
`strain_energy` and `kinetic_energy` look at it. The element algebra is in `algebra` and `elements`; `generate`
holds its two compiled back ends (chosen by WIZEN_KERNEL = auto, vector or scalar).
"""

from solver.dehydration.kernel.bulk import dilatations, pressure_energy, rested, rests, without_bulk
from solver.dehydration.kernel.coupled import Weights, held_outside, momentum
from solver.dehydration.kernel.diagnostics import (
    ElementReport,
    element_report,
    kinetic_energy,
    least_ratios,
    strain_energy,
)
from solver.dehydration.kernel.fixed_point import out_of_reach, place, positions
from solver.dehydration.kernel.layout import Layout, build_layout
from solver.dehydration.kernel.march import (
    Backend,
    InternalForce,
    default_backend,
    internal_force,
    march,
    new_state,
)
from solver.dehydration.kernel.reweigh import reweigh, stiffness_bounds
from solver.dehydration.kernel.skin import Skin, forget, make_skin, weigh

__all__ = [
    "Backend",
    "ElementReport",
    "InternalForce",
    "Layout",
    "Skin",
    "Weights",
    "build_layout",
    "default_backend",
    "dilatations",
    "element_report",
    "forget",
    "held_outside",
    "internal_force",
    "kinetic_energy",
    "least_ratios",
    "make_skin",
    "march",
    "momentum",
    "new_state",
    "out_of_reach",
    "place",
    "positions",
    "pressure_energy",
    "rested",
    "rests",
    "reweigh",
    "stiffness_bounds",
    "strain_energy",
    "weigh",
    "without_bulk",
]
