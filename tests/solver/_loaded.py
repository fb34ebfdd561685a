"""Fruits of the solver's own parameters, and the drive that loads them."""

from __future__ import annotations

import numpy as np

from solver import registry
from solver.dehydration.drive import Drive
from solver.dehydration.fresh.mesh import build_mesh
from solver.dehydration.kernel import build_layout

SOLVER = registry.get("dehydration")


def parse(preset="sphere", **values):
    return SOLVER.parse(values, preset=preset)


def drive_of(params, n=6, layers=4, one_point=False):
    mesh = build_mesh(params, n, np.linspace(0, 1, layers + 1))
    mu = np.where(mesh.is_exocarp, params.modulus_ratio, 1.0)
    layout = build_layout(
        mesh.positions, mesh.connectivity, mesh.is_exocarp, mu, 100 * mu, mesh.fixed, one_point=one_point
    )
    return mesh, layout, Drive(params, mesh, layout)
