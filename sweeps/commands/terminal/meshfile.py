"""Triangle meshes in files as values of parameters: `--set mesh=@fruit.obj`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ... import foreign
from ...errors import InvalidOption, SweepError
from ...foreign import KINDS

__all__ = ["KINDS", "read"]


def read(path: Path) -> dict[str, Any]:
    """Return points and faces of a mesh file; points in one place become one, as triangles must share them.

    Raises:
        InvalidOption: no such kind of file, nothing that can be read in it, or trimesh is not installed.

    """
    try:
        mesh = foreign.read(path)
        foreign.sound(path, np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64))
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        points, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    except SweepError as error:
        raise InvalidOption(error.message, error.advice) from None
    used, faces = np.unique(faces, return_inverse=True)
    return {"points": points[used].tolist(), "faces": faces.reshape(-1, 3).tolist()}
