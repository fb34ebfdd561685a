"""Triangle meshes in files as values of parameters: `--set mesh=@fruit.obj`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidOption, installing

__all__ = ["KINDS", "read"]

KINDS = (".obj", ".ply", ".glb", ".stl")


def read(path: Path) -> dict[str, Any]:
    """Return points and faces of a mesh file; points in one place become one, as triangles must share them.

    Raises:
        InvalidOption: no such kind of file, nothing that can be read in it, or trimesh is not installed.

    """
    if path.suffix.lower() not in KINDS:
        raise InvalidOption(f"{path.name!r} is no mesh.", f"Known: {', '.join(KINDS)}.")
    if not path.is_file():
        raise InvalidOption(f"there is no file {path}.", "Name a mesh file.")
    try:
        import trimesh
    except ImportError:
        raise InvalidOption("meshes need the package trimesh.", installing("formats")) from None
    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        points, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    except OSError as error:
        raise InvalidOption(f"{path}: {error.strerror or error}.", "Name a mesh file.") from None
    except Exception as error:
        raise InvalidOption(
            f"{path} cannot be read: {error}.", f"Write it anew as one of {', '.join(KINDS)}."
        ) from None
    if faces.ndim != 2 or not len(faces):
        raise InvalidOption(f"{path} holds no triangles.", "Name a mesh of triangles.")
    used, faces = np.unique(faces, return_inverse=True)
    return {"points": points[used].tolist(), "faces": faces.reshape(-1, 3).tolist()}
