"""Triangle meshes as values of parameters."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, model_validator

__all__ = ["MOST_GROUPS", "ClosedMesh", "GivenMesh", "check_faces", "check_groups", "check_textures", "named_groups"]

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
        if isinstance(values, str) or values is None:
            raise ValueError(
                "expected points and faces; on the command line, --set mesh=@FILE reads them from a file, "
                'in a params file mesh = "@FILE"'
            )
        return values


def check_faces(points: int, faces: Sequence[Sequence[int]]) -> None:
    """Refuse triangles of vertices that are not there, of a mesh of so many points; before there is an array of them,
    which holds no number of more than 64 bits.

    Raises:
        ValueError: a number below 0 or too large.

    """
    if min(map(min, faces)) < 0 or max(map(max, faces)) >= points:
        raise ValueError(f"a triangle names a vertex that is not there: they are numbered 0 to {points - 1}")


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


#: What mesh files hold besides.
_DRESS = frozenset({"uv", "uv_faces", "materials", "face_materials", "groups"})


class ClosedMesh(GivenMesh):
    """A closed triangle mesh, convex or not. Of a file's textures, materials and groups nothing is kept."""

    points: tuple[tuple[float, float, float], ...]
    faces: tuple[tuple[int, int, int], ...]

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, values: object) -> object:
        if isinstance(values, dict):
            return {name: values[name] for name in values if name in cls.model_fields or name not in _DRESS}
        return values

    @model_validator(mode="after")
    def _closed(self) -> Self:
        check_faces(len(self.points), self.faces)
        points, faces = np.array(self.points), np.array(self.faces, np.int64)
        ways = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        key, back = ways[:, 0] * len(points) + ways[:, 1], ways[:, 1] * len(points) + ways[:, 0]
        sides, times = np.unique(key, return_counts=True)
        alone = int((~np.isin(key, back)).sum())
        if alone:
            raise ValueError(
                f"the mesh is open: {alone} sides of triangles have no neighbour. Close it, or let all triangles look "
                "outwards"
            )
        if (times > 1).any() or len(sides) != len(key):
            raise ValueError("more than two triangles of the mesh share a side, or two look opposite ways: mend it")
        a, b, c = (points[faces[:, k]] for k in range(3))
        if float((a * np.cross(b, c)).sum()) <= 0:
            raise ValueError("the mesh encloses nothing: let its triangles be counter-clockwise from outside")
        return self
