"""Triangle meshes in files as values of parameters: `--set mesh=@fruit.obj`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ... import foreign
from ...errors import InvalidOption, SweepError
from ...foreign import KINDS
from ...meshparts import Parts, glb, obj

__all__ = ["KINDS", "read"]


def read(path: Path) -> dict[str, Any]:
    """Return points and faces of a mesh file, and its texture coordinates and materials if it has some.

    Points in one place become one, as triangles must share them; the others keep their order. Texture coordinates stay
    those of the file's corners.

    Raises:
        InvalidOption: no such kind of file, nothing that can be read in it, or trimesh is not installed.

    """
    try:
        parts = _parts(path)
        foreign.sound(path, parts.points, parts.faces)
    except SweepError as error:
        raise InvalidOption(error.message, error.advice) from None
    return _merged(parts)


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
    return Parts(np.asarray(mesh.vertices, float), faces, None, None, (), np.zeros(len(faces), np.int64))


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
    found: dict[str, Any] = {"points": parts.points[kept[first[order]]].tolist(), "faces": shared[~flat].tolist()}
    if parts.uv is not None and parts.corners is not None:
        found |= {"uv": parts.uv.tolist(), "uv_faces": parts.corners[~flat].tolist()}
    if parts.materials:
        found |= {"materials": list(parts.materials), "face_materials": parts.material[~flat].tolist()}
    return found
