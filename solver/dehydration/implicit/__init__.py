"""Implicit solution of the smooth shrunk fruit: hex27 displacements, trilinear pressures, symmetry, full Newton."""

from __future__ import annotations

from .base_state import BaseState, base_state, carried
from .mesh import (
    Band,
    Patch,
    QuadraticMesh,
    Symmetry,
    build_band_mesh,
    build_quadratic_mesh,
    graded_layers,
    natural_symmetry,
)
from .newton import Equilibrium, Loading, Model, build_model, equilibrium

__all__ = [
    "Band",
    "BaseState",
    "Equilibrium",
    "Loading",
    "Model",
    "Patch",
    "QuadraticMesh",
    "Symmetry",
    "base_state",
    "build_band_mesh",
    "build_model",
    "build_quadratic_mesh",
    "carried",
    "equilibrium",
    "graded_layers",
    "natural_symmetry",
]
