"""A surface of the user's own in place of the fruit's: any triangle mesh, closed or open, in units of r1 (D45).

What is given by angles is seen from the mesh's middle: the centre of the sphere that fits its points best, which is the
fruit's own for a patch of its skin. Nothing flows over an open border.
"""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from ...arrays import Floats
from ...contract.mesh import GivenMesh, check_faces, check_groups, check_textures
from .surface import Extent, Surface

__all__ = ["Mesh", "extent_of", "rays_from"]


class Mesh(GivenMesh):
    """Points and triangles; triangles that share an edge share its two points."""

    points: tuple[tuple[float, float, float], ...] = Field(
        min_length=3, max_length=400_000, description="Vertices [r1]"
    )
    faces: tuple[tuple[int, int, int], ...] = Field(
        min_length=1, max_length=800_000, description="Triangles, as numbers of vertices from 0"
    )
    uv: tuple[tuple[float, float], ...] = Field(
        (), max_length=2_400_000, description="Texture coordinates, v upwards; files that are made of it keep them [1]"
    )
    uv_faces: tuple[tuple[int, int, int], ...] = Field(
        (), max_length=800_000, description="The triangles' corners, as numbers of texture coordinates from 0"
    )
    materials: tuple[str, ...] = Field((), max_length=256, description="Names of materials, for files made of it")
    face_materials: tuple[int, ...] = Field((), max_length=800_000, description="The material of each triangle, from 0")
    groups: dict[str, tuple[float, ...]] = Field(
        {},
        max_length=64,
        description="Vertex groups, or any numbers of points, by name: a weight for each point; files keep them [1]",
    )

    @model_validator(mode="after")
    def _within(self) -> Self:
        check_faces(len(self.points), self.faces)
        check_textures(len(self.faces), len(self.uv), self.uv_faces, len(self.materials), self.face_materials)
        check_groups(len(self.points), self.groups)
        return self


def rays_from(points: Floats) -> Floats:
    """Return unit directions (v, 3) of points (v, 3) from the middle of the sphere that fits them best."""
    about = points - points.mean(axis=0)
    # |x|^2 = 2 c.x + k, least squares; of a flat mesh the least c
    system = np.concatenate([2 * about, np.ones((len(about), 1))], axis=1)
    centre = np.linalg.lstsq(system, (about**2).sum(axis=1), rcond=1e-6)[0][:3]
    away = about - centre
    far = np.linalg.norm(away, axis=1, keepdims=True)
    return np.where(far > 0, away / np.maximum(far, 1e-300), [0.0, 1.0, 0.0])


def extent_of(surface: Surface) -> Extent | None:
    """Return area and volume of a closed mesh, whichever way it is wound; None of an open one."""
    faces = surface.faces
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any():
        return None
    a, b, c = (surface.points[faces[:, k]] for k in range(3))
    return Extent(surface.total(1.0), abs(float(np.sum(a * np.cross(b, c)))) / 6)
