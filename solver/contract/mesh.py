"""Triangle meshes as values of parameters."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

from pydantic import BaseModel, ConfigDict, model_validator

__all__ = ["MOST_GROUPS", "GivenMesh", "check_groups", "check_textures", "named_groups"]

#: Groups of a mesh, and letters of the name of one, at most.
MOST_GROUPS, _LETTERS = 64, 64
#: What a weight may be at most: files hold single precision.
_HEAVIEST = 1e30


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


def check_groups(points: int, groups: Mapping[str, Sequence[float]]) -> None:
    """Refuse groups that do not belong to a mesh of so many points, or whose names files could not tell apart.

    Raises:
        ValueError: too many, too few weights or such as are no numbers of single precision, a name that is empty, long,
            or another's but for signs and capitals.

    """
    if len(groups) > MOST_GROUPS:
        raise ValueError(f"{len(groups)} groups are more than {MOST_GROUPS}")
    known: dict[str, str] = {}
    for name, weights in groups.items():
        if len(weights) != points:
            raise ValueError(f"the group {name[:40]!r} has {len(weights)} weights for {points} points")
        heavy = next((k for k, weight in enumerate(weights) if not abs(weight) <= _HEAVIEST), None)
        if heavy is not None:
            raise ValueError(
                f"the group {name[:40]!r} has the weight {weights[heavy]:g} at point {heavy}; give numbers up to "
                f"{_HEAVIEST:g}, as files hold single precision"
            )
        plain = re.sub(r"\W", "_", name, flags=re.ASCII).upper()
        if not plain.strip("_") or len(name) > _LETTERS:
            raise ValueError(f"the group {name[:40]!r} needs a name of letters and digits, at most {_LETTERS}")
        if plain in known:
            raise ValueError(f"files do not tell the groups {known[plain]!r} and {name!r} apart: rename one")
        known[plain] = name


def named_groups(groups: Mapping[str, object]) -> dict[str, str]:
    """Return the names of a mesh's groups, as an attribute of a result."""
    return {"groups": json.dumps(list(groups))} if groups else {}
