"""Fruits that are cut: halves, slices and wedges as bodies of their own, closed by their cut faces (D54).

Vertices that lie nearer to a plane than a share of the least height of their triangles are moved into it first, so that
no sliver is left to make steps dear. What is left is a closed mesh, each of whose edges two triangles have, and whose
vertices in a plane are bare flesh.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ...arrays import Bools, Floats, Ints
from ...contract import InvalidInput
from ...contract.space import Direction, Position
from ...geometry.halved import face, halved, heights
from .imported import Mesh, extent_of
from .surface import Surface, triangulated

__all__ = ["Cut", "Left", "bare", "left"]

#: Share of a triangle's height within which a vertex is moved into a plane: below a half, so that none is turned over
#: and none that stands across the plane is laid flat; and the distance below which a place is in it [r1].
_SNAP, _ONE = 0.4, 1e-6


class Cut(BaseModel):
    """A plane that takes a part of the fruit away."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    point: Position = Field((0.0, 0.0, 0.0), description="A point of the plane [r1]")
    normal: Direction = Field(description="Across the plane, to the part that goes [1]")

    def away(self, points: Floats) -> Floats:
        """Return how far points (k, 3) are beyond the plane [r1]."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        found: Floats = (points - np.array(self.point)) @ normal
        return found


class Left(BaseModel):
    """What cuts leave of a fruit: its mesh, and its volume over that of the whole."""

    mesh: Mesh
    share: float


def bare(cuts: tuple[Cut, ...], points: Floats) -> Bools:
    """Return which points (k, 3) lie in a cut."""
    found = np.zeros(len(points), np.bool_)
    for cut in cuts:
        found |= np.abs(cut.away(points)) < _ONE
    return found


def left(surface: Surface, cuts: tuple[Cut, ...]) -> Left:
    """Return what the cuts leave of a closed surface.

    Raises:
        InvalidInput: the surface is open, or a cut misses it or leaves nothing of it.

    """
    whole = extent_of(surface)
    if whole is None:
        raise InvalidInput("an open mesh has no inside that a cut could show.", advice="Close it, or leave cuts out.")
    points, faces = surface.points, surface.faces
    a, b, c = (points[faces[:, k]] for k in range(3))
    if float(np.sum(a * np.cross(b, c))) < 0:
        faces = faces[:, ::-1]
    edge = float(np.median(np.linalg.norm(points[faces[:, 0]] - points[faces[:, 1]], axis=1)))
    for number, cut in enumerate(cuts):
        points, faces = _cut(points, faces, cut, edge, number)
    mesh = Mesh(points=tuple(map(tuple, points.tolist())), faces=tuple(map(tuple, faces.tolist())))
    found = extent_of(triangulated(points, faces))
    if found is None:
        raise InvalidInput(
            "the cuts do not leave a closed body.", advice="Move them a little, or take a mesh without folds."
        )
    return Left(mesh=mesh, share=found.volume / whole.volume)


def _cut(points: Floats, faces: Ints, cut: Cut, edge: float, number: int) -> tuple[Floats, Ints]:
    normal = np.array(cut.normal) / np.linalg.norm(cut.normal)
    away = cut.away(points)
    if not away.min() < -edge or not away.max() > edge:
        raise InvalidInput(
            f"cut {number} {'leaves nothing of' if away.max() > edge else 'misses'} the fruit.",
            advice="Move its point: the middle of the fruit is near 0,0,0, and its normal shows to the part that goes.",
        )
    near = np.abs(away) < _SNAP * heights(points, faces)
    points = np.where(near[:, None], points - away[:, None] * normal, points)
    half = halved(points, faces, np.array(cut.point), normal)
    closing = face(half, np.array(cut.point), normal, edge)
    known = len(closing.numbers)
    place = np.concatenate([closing.numbers, len(half.points) + np.arange(len(closing.points) - known)])
    return np.concatenate([half.points, closing.points[known:]]), np.concatenate(
        [half.triangles, place[closing.triangles]]
    )
