"""Triangle meshes in files as values of parameters: `--set mesh=@fruit.obj`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from solver.arrays import Floats, Ints

from ... import foreign
from ...errors import InvalidOption, SweepError
from ...foreign import KINDS
from ...meshparts import Parts, check_count, glb, obj

__all__ = ["KINDS", "read"]

#: Properties of a PLY file's vertices that say something else than how much they belong to a group.
_USUAL = frozenset(
    ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "s", "t", "u", "v", "texture_u", "texture_v")
)


def read(path: Path) -> dict[str, Any]:
    """Return points and faces of a mesh file, and its texture coordinates, materials and vertex groups if it has some.

    Points in one place become one, as triangles must share them; the others keep their order. Texture coordinates stay
    those of the file's corners.

    Raises:
        InvalidOption: no such kind of file, nothing that can be read in it, no triangle with three places, more groups
            than a mesh may have, a group with a weight that is not finite, or trimesh is not installed.

    """
    try:
        parts = _parts(path)
        foreign.sound(path, parts.points, parts.faces)
    except SweepError as error:
        raise InvalidOption(error.message, error.advice) from None
    found = _merged(parts)
    if not found["faces"]:
        raise InvalidOption(f"{path.name}: no triangle of it has three places.", "Take one that has a surface.")
    return found


def _parts(path: Path) -> Parts:
    kind = path.suffix.lower()
    if kind in (".obj", ".glb"):
        data = foreign.checked(path)
        try:
            return obj(data.decode(errors="replace")) if kind == ".obj" else glb(data)
        except (ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
            if kind == ".obj":
                raise foreign.ForeignMesh(path, str(error)[:200]) from None
            # what is packed is for the library to unpack, without texture coordinates
    mesh = foreign.read(path)
    faces = np.asarray(mesh.faces, np.int64)
    rest = None, None, (), np.zeros(len(faces), np.int64), _properties(mesh) if kind == ".ply" else {}
    return Parts(np.asarray(mesh.vertices, float), faces, *rest)


def _properties(mesh: Any) -> dict[str, Any]:
    """Return the numbers of a PLY file's vertices that are neither place, normal, colour nor texture coordinate."""
    try:
        rows = mesh.metadata["_ply_raw"]["vertex"]["data"]
        names = [name for name in (rows.dtype.names if hasattr(rows, "dtype") else rows) if name not in _USUAL]
        found = {name: np.asarray(rows[name], float).ravel() for name in names}
    except (KeyError, TypeError, ValueError, AttributeError):
        return {}
    return {name: values for name, values in found.items() if len(values) == len(mesh.vertices)}


def _merged(parts: Parts) -> dict[str, Any]:
    """Return a mesh whose triangles share points, in the order in which the file first names each place."""
    faces = parts.faces
    used = np.zeros(len(parts.points), np.bool_)
    used[faces] = True
    kept = np.flatnonzero(used)
    _, first, back = np.unique(parts.points[kept], axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    number = np.full(len(parts.points), -1)
    number[kept] = rank[back.ravel()]
    shared = number[faces]
    # two corners in one place leave no triangle
    flat = (shared == np.roll(shared, 1, axis=1)).any(axis=1)
    chosen = kept[first[order]]
    found: dict[str, Any] = {"points": parts.points[chosen].tolist(), "faces": shared[~flat].tolist()}
    if parts.uv is not None and parts.corners is not None:
        found |= {"uv": parts.uv.tolist(), "uv_faces": parts.corners[~flat].tolist()}
    if parts.materials:
        found |= {"materials": list(parts.materials), "face_materials": parts.material[~flat].tolist()}
    check_count(len(parts.groups))
    groups = {name: weights[chosen] for name, weights in parts.groups.items()}
    _check_weights(groups, chosen)
    if groups:
        found["groups"] = {name: weights.tolist() for name, weights in groups.items()}
    return found


def _check_weights(groups: Mapping[str, Floats], points: Ints) -> None:
    """Refuse groups with weights that are no numbers; points: the file's numbers of what weights (p,) belong to.

    Raises:
        InvalidOption: a weight is not finite.

    """
    for name, weights in groups.items():
        wrong = np.flatnonzero(~np.isfinite(weights))
        if len(wrong):
            raise InvalidOption(
                f"the group {name[:40]!r} has no finite weight at {len(wrong)} of {len(weights)} points, "
                f"the first of which is point {points[wrong[0]]} of the file.",
                "Give every point a number, 0 where it does not belong to the group, or delete the group.",
            )
