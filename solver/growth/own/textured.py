"""What a mesh of one's own brings: texture coordinates and materials ride on triangles, groups on vertices."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...arrays import Floats, Ints
from ...contract.mesh import named_groups
from ..state import State
from .imported import OwnMesh

__all__ = ["corners_of", "faces_of", "groups_of", "named", "textured"]


def corners_of(mesh: OwnMesh | None) -> dict[str, Floats]:
    """Return texture coordinates (f, 3, 2) of a mesh's corners, for `State.corners`; nothing where it has none."""
    return {"uv": np.array(mesh.uv, float)[np.array(mesh.uv_faces, np.int64)]} if mesh and mesh.uv else {}


def faces_of(mesh: OwnMesh | None) -> dict[str, Ints]:
    """Return numbers of the materials (f,) of a mesh's triangles, for `State.faces`; nothing where it has none."""
    return {"material": np.array(mesh.face_materials, np.int64)} if mesh and mesh.face_materials else {}


def groups_of(mesh: OwnMesh | None) -> dict[str, Floats]:
    """Return weights of the groups (n, k) of a mesh's vertices, for `State.matter`; nothing where it has none."""
    if mesh is None or not mesh.groups:
        return {}
    used = np.unique(np.array(mesh.faces, np.int64))
    return {"groups": np.array(list(mesh.groups.values()), float).T[used]}


def named(mesh: OwnMesh | None) -> dict[str, str]:
    """Return the names of a mesh's materials and groups, as attributes."""
    if mesh is None:
        return {}
    return ({"materials": json.dumps(mesh.materials)} if mesh.face_materials else {}) | named_groups(mesh.groups)


def textured(states: Sequence[State]) -> dict[str, Any]:
    """Return what rides on the triangles and vertices of stages as variables, end to end (`solver.meshes`)."""
    found: dict[str, Any] = {}
    if states[0].corners:
        seams = [_seam(state) for state in states]
        found["texture_coordinate"] = (("texture_vertex", "uv"), np.concatenate([uv for uv, _ in seams]))
        found["texture_triangle"] = (("face", "corner"), np.concatenate([at for _, at in seams]).astype(np.int32))
        found["texture_count"] = ("stage", np.array([len(uv) for uv, _ in seams], np.int32))
    if states[0].faces:
        found["face_material"] = (("face",), np.concatenate([s.faces["material"] for s in states]).astype(np.int32))
    if "groups" in states[0].matter:
        weights = np.concatenate([s.matter["groups"] for s in states])
        found["group_weight"] = (("vertex", "group"), weights.astype(np.float32))
    return found


def _seam(state: State) -> tuple[Floats, Ints]:
    """Return texture coordinates (w, 2), one for each vertex and pair of numbers, and the corners' (f, 3)."""
    rows = np.column_stack([state.mesh.triangles.ravel(), state.corners["uv"].reshape(-1, 2)])
    pairs, back = np.unique(rows, axis=0, return_inverse=True)
    return pairs[:, 1:].astype(float), back.reshape(-1, 3).astype(np.int64)
