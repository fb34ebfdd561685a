"""Thin shells as triangles: a membrane against a rest metric, hinges against rest angles, an SPD tangent.

Energies are in units of mu l^2 (mu: the membrane's shear modulus times its thickness, force per length; l: the
solver's unit of length), forces in mu l. Every kernel takes arrays and returns arrays; none knows of time or tools.
"""

from .bending import angles, bending, bending_tangent, hinge_stiffness
from .contact import (
    Near,
    Pairs,
    any_cross,
    barrier,
    barrier_diagonal,
    barrier_hessian,
    changed,
    close_faces,
    flat,
    free_step,
    near_of,
    owners,
    search,
    within,
)
from .curvature import added_angles, from_angles
from .halves import Halves
from .hessian import bending_hessian, membrane_hessian, volume_hessian
from .material import Material
from .mean import mean_bending, mean_stiffness
from .membrane import areas, membrane, membrane_tangent, metric, metric_of_lengths
from .pattern import Pattern, pattern
from .topology import Topology, part_of, topology

__all__ = [
    "Halves",
    "Material",
    "Near",
    "Pairs",
    "Pattern",
    "Topology",
    "added_angles",
    "angles",
    "any_cross",
    "areas",
    "barrier",
    "barrier_diagonal",
    "barrier_hessian",
    "bending",
    "bending_hessian",
    "bending_tangent",
    "changed",
    "close_faces",
    "flat",
    "free_step",
    "from_angles",
    "hinge_stiffness",
    "mean_bending",
    "mean_stiffness",
    "membrane",
    "membrane_hessian",
    "membrane_tangent",
    "metric",
    "metric_of_lengths",
    "near_of",
    "owners",
    "part_of",
    "pattern",
    "search",
    "topology",
    "volume_hessian",
    "within",
]
