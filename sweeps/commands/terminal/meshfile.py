"""Triangle meshes in files as values of parameters: `--set mesh=@fruit.obj`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidOption, installing
from .meshparts import Parts, glb, obj

__all__ = ["KINDS", "read"]

KINDS = (".obj", ".ply", ".glb", ".stl")


def read(path: Path) -> dict[str, Any]:
    """Return points and faces of a mesh file, and its texture coordinates and materials if it has some.

    Points in one place become one, as triangles must share them; the others keep their order. Texture coordinates stay
    those of the file's corners.

    Raises:
        InvalidOption: no such kind of file, nothing that can be read in it, or trimesh is not installed.

    """
    if path.suffix.lower() not in KINDS:
        raise InvalidOption(f"{path.name!r} is no mesh.", f"Known: {', '.join(KINDS)}.")
    if not path.is_file():
        raise InvalidOption(f"there is no file {path}.", "Name a mesh file.")
    try:
        parts = _parts(path)
    except OSError as error:
        raise InvalidOption(f"{path}: {error.strerror or error}.", "Name a mesh file.") from None
    except InvalidOption:
        raise
    except Exception as error:  # readers of foreign files stumble in as many ways as there are files
        raise InvalidOption(
            f"{path} cannot be read: {error}.", f"Write it anew as one of {', '.join(KINDS)}."
        ) from None
    if not len(parts.faces):
        raise InvalidOption(f"{path} holds no triangles.", "Name a mesh of triangles.")
    return _merged(path, parts)


def _parts(path: Path) -> Parts:
    if path.suffix.lower() == ".obj":
        return obj(path)
    if path.suffix.lower() == ".glb":
        try:
            return glb(path)
        except (ValueError, KeyError, IndexError, TypeError):
            pass  # what is packed is for the library to unpack, without texture coordinates
    try:
        import trimesh
    except ImportError:
        raise InvalidOption("meshes need the package trimesh.", installing("formats")) from None
    mesh: Any = trimesh.load(path, force="mesh", process=False)
    faces = np.asarray(mesh.faces, np.int64)
    return Parts(np.asarray(mesh.vertices, float), faces, None, None, (), np.zeros(len(faces), np.int64))


def _merged(path: Path, parts: Parts) -> dict[str, Any]:
    """Return a mesh whose triangles share points, in the order in which the file first names each place."""
    faces = parts.faces
    if faces.min() < 0 or faces.max() >= len(parts.points) or not np.isfinite(parts.points).all():
        raise InvalidOption(
            f"{path} holds numbers that are not finite, or corners that are no vertices.", "Write it anew."
        )
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
