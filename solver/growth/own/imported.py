"""A start shape of the user's own: any triangle mesh that is a surface, closed or open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np
from pydantic import Field, model_validator

from ...arrays import Floats, Ints
from ...contract import InvalidGeometry
from ...contract.mesh import GivenMesh, check_faces, check_groups, check_textures

if TYPE_CHECKING:
    from ... import shell
    from ..shapes import Mesh

__all__ = ["OwnMesh"]

#: Least area of a triangle over the square of its longest side.
_THIN = 1e-6
#: A vertex farther away than this [start shape's unit] is refused: positions in single precision end at 3e38.
_FAR = 1e30


class OwnMesh(GivenMesh):
    """Points and triangles; triangles that share an edge share its two points."""

    points: tuple[tuple[float, float, float], ...] = Field(
        min_length=3, max_length=100_000, description="Vertices [start shape's unit]"
    )
    faces: tuple[tuple[int, int, int], ...] = Field(
        min_length=1, max_length=200_000, description="Triangles, counter-clockwise from outside, vertices from 0"
    )
    uv: tuple[tuple[float, float], ...] = Field(
        (),
        max_length=600_000,
        description="Texture coordinates, v upwards; they ride on the sheet [1]",
    )
    uv_faces: tuple[tuple[int, int, int], ...] = Field(
        (), max_length=200_000, description="The triangles' corners, as numbers of texture coordinates from 0"
    )
    materials: tuple[str, ...] = Field((), max_length=256, description="Names of materials, for files made of it")
    face_materials: tuple[int, ...] = Field((), max_length=200_000, description="The material of each triangle, from 0")
    groups: dict[str, tuple[float, ...]] = Field(
        {},
        max_length=64,
        description="Vertex groups, or any numbers of points, by name: a weight for each point; files keep them [1]",
    )

    @model_validator(mode="after")
    def _is_a_surface(self) -> Self:
        # parameters and schemas are read without what compiles
        from ... import shell

        check_faces(len(self.points), self.faces)
        check_textures(len(self.faces), len(self.uv), self.uv_faces, len(self.materials), self.face_materials)
        check_groups(len(self.points), self.groups)
        points, faces = np.array(self.points), np.array(self.faces, np.int64)
        if np.abs(points).max() > _FAR:
            raise ValueError(f"a vertex is more than {_FAR:g} away. Move the mesh to the origin, or take another unit.")
        try:
            top = shell.topology(faces, len(points))
        except InvalidGeometry as error:
            raise ValueError(str(error)) from None
        sides = points[faces] - np.roll(points[faces], 1, axis=1)
        areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
        thin = int((areas <= _THIN * (sides**2).sum(-1).max(axis=1)).sum())
        if thin:
            raise ValueError(f"{thin} triangles have no area to speak of. Collapse their shortest edges.")
        if _inside_out(points, faces):
            raise ValueError(
                "the mesh is inside out: pressure and outgrowth would act inwards. Turn its triangles over, so that "
                "they are counter-clockwise from outside (Blender: Mesh, Normals, Recalculate Outside)."
            )
        pinched = _pinched(top)
        if pinched:
            raise ValueError(f"{pinched} vertices hold parts together that share no edge there. Split them.")
        return self

    def shape(self) -> Mesh:
        """Return it as a start shape, without the points that no triangle has."""
        from ..shapes import Mesh

        used, faces = np.unique(np.array(self.faces, np.int64), return_inverse=True)
        return Mesh(np.array(self.points)[used], faces.reshape(-1, 3))


def _inside_out(points: Floats, faces: Ints) -> bool:
    """Return whether a closed mesh encloses less than nothing; of parts, one in another, all together."""
    from ..shapes import is_closed

    about = points - points[faces].mean(axis=(0, 1))
    a, b, c = about[faces].transpose(1, 0, 2)
    return float(np.einsum("fi,fi->", a, np.cross(b, c))) < 0 and is_closed(faces)


def _pinched(mesh: shell.Topology) -> int:
    """Return how many more fans of triangles there are than vertices that have triangles."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces, corners = mesh.hinge_faces, mesh.hinge_corners
    # both triangles of a hinge have the edge's ends at the corners after their opposite one, in turn
    ends = [3 * faces[:, 0] + (corners[:, 0] + k) % 3 for k in (1, 2)]
    others = [3 * faces[:, 1] + (corners[:, 1] + k) % 3 for k in (2, 1)]
    count = mesh.triangles.size
    i, j = np.concatenate(ends), np.concatenate(others)
    fans, _ = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(count, count)), directed=False)
    return int(fans - len(np.unique(mesh.triangles)))
