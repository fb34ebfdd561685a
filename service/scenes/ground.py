"""A mesh that things stand on."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from solver.arrays import Array, Floats
from solver.contract.mesh import GivenMesh, check_faces

__all__ = ["Ground", "across", "corner_normals"]

#: Least area of a mesh [squares of its largest coordinate].
_LEAST = 1e-12


class Ground(GivenMesh):
    """Points and triangles, counter-clockwise from the side that things stand on. Else it keeps nothing."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    points: tuple[tuple[float, float, float], ...] = Field(
        min_length=3, max_length=100_000, description="Vertices [scene unit]"
    )
    faces: tuple[tuple[int, int, int], ...] = Field(
        min_length=1, max_length=200_000, description="Triangles, as numbers of vertices from 0"
    )

    @model_validator(mode="after")
    def _has_area(self) -> Self:
        check_faces(len(self.points), self.faces)
        points, faces = self.arrays
        size = float(np.abs(points).max())
        if size > 1e9:
            raise ValueError("a vertex is more than 1e9 away: take another unit")
        if not float(np.linalg.norm(across(points, faces), axis=1).sum()) > 2 * _LEAST * size**2:
            raise ValueError("its triangles have no area: nothing can stand on it")
        return self

    @property
    def arrays(self) -> tuple[Floats, Array]:
        """Points (v, 3) and triangles (f, 3)."""
        return np.array(self.points, float), np.array(self.faces, np.int64)


def across(points: Floats, faces: Array) -> Floats:
    """Return normals of triangles (f, 3), as long as twice their area."""
    a, b, c = points[faces].transpose(1, 0, 2)
    return np.asarray(np.cross(b - a, c - a))


def corner_normals(points: Floats, faces: Array) -> Floats:
    """Return unit normals at vertices (v, 3): those of their triangles, by area."""
    normals, found = across(points, faces), np.zeros_like(points)
    for corner in range(3):
        np.add.at(found, faces[:, corner], normals)
    length = np.linalg.norm(found, axis=1)
    found[length > 0] /= length[length > 0, None]
    found[length == 0] = (0.0, 1.0, 0.0)
    return found
