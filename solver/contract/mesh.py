"""Triangle meshes as values of parameters."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict, model_validator

__all__ = ["GivenMesh", "check_textures"]


class GivenMesh(BaseModel):
    """Base of the meshes that users give; its children say how many points and triangles they take, and in what units.

    Read from text it refuses, with what to write instead.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _read(cls, values: object) -> object:
        if isinstance(values, str):
            raise ValueError("expected points and faces; on the command line, --set mesh=@FILE reads them from a file")
        return values


def check_textures(
    faces: int, uv: int, uv_faces: Sequence[Sequence[int]], materials: int, face_materials: Sequence[int]
) -> None:
    """Refuse texture coordinates and materials that do not belong to a mesh of so many faces.

    Raises:
        ValueError: too few rows, or numbers of what is not there.

    """
    for name, given, known in (("uv_faces", uv_faces, uv), ("face_materials", face_materials, materials)):
        numbers = [n for row in given for n in (row if isinstance(row, Sequence) else (row,))]
        if given and (len(given) != faces or min(numbers) < 0 or max(numbers) >= known):
            raise ValueError(f"{name} has a row for each of the {faces} triangles, of numbers below {known}")
    if uv and not uv_faces:
        raise ValueError("uv without uv_faces belongs to no triangle")
