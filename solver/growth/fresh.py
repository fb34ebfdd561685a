"""The state before any growth: the perfect shape at rest, and a shape that is a little off."""

from __future__ import annotations

import numpy as np

from .. import shell
from ..contract import Context
from .matter import matter, springs, thickness_map
from .own.textured import corners_of, faces_of, groups_of
from .params import GrowthParams
from .shapes import Ground, Mesh
from .state import State
from .tooling.holding import Holds, known, loosened
from .tooling.holding import held as held_by
from .tooling.placing import border

__all__ = ["fresh"]


def fresh(params: GrowthParams, mesh: Mesh) -> State:
    """Return the start: rest state of the perfect shape, shape with its imperfection."""
    top = shell.topology(mesh.triangles, len(mesh.x))
    p = mesh.x[mesh.triangles]
    normals = np.zeros_like(mesh.x)
    np.add.at(normals, mesh.triangles, np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, None, :])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offset = Context.generator(params.seed).normal(size=len(mesh.x)) * params.imperfection * params.thickness
    corners = corners_of(params.mesh)
    ground = Ground(mesh, border(top), corners.get("uv"))
    material = matter(params.ribs, params.colours, ground, params.seed) | groups_of(params.mesh)
    if params.thicknesses:
        material["thick"] = thickness_map(params.thicknesses, ground, params.seed)
        offset *= material["thick"]
    x = mesh.x + offset[:, None] * normals
    if params.bed:
        flexural = shell.Material(params.thickness, params.poisson).flexural
        below, stiffer = springs(params.bed, flexural, ground, params.seed)
        # the ground is uneven: a sheet that is uneven alone would be pressed flat long before it folds
        material["bed"] = np.concatenate([below[:, None], x, normals], axis=1)
        if stiffer.any():
            material["stiff"] = material.get("stiff", 0.0) + stiffer
    if params.normal_force:
        material["pushed"] = np.zeros_like(x)
    holds = Holds(params.attached, ground, params.seed)
    held, led = held_by(holds)
    material |= known(holds) if params.attached else {}
    material |= {"led": led} if led.any() else {}
    angles = shell.angles(mesh.x, top.hinges)
    x = np.where(held, mesh.x, x)
    state = State(
        time=0.0,
        x=x,
        mesh=top,
        g=shell.metric(mesh.x, mesh.triangles),
        rest=angles if params.curved else np.zeros_like(angles),
        shares={},
        held=held,
        spots={},
        curves={},
        matter=material,
        corners=corners,
        faces=faces_of(params.mesh),
        holds=holds if params.attached else None,
    )
    return loosened(state)
