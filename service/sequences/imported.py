"""A mesh of the user's own, moved as a result moves: the vertex cache that belongs to it.

The mesh is laid on the result's first stage: centred by its bounding box and scaled alike in all directions to the same
box diagonal (`fit="box"`), or left where it is (`fit="none"`). Each of its vertices is then bound to a place on the
first stage's surface, and moves by that place's displacement, undone by the fit. Places are the nearest ones
(`binding="nearest"`), or those in the same direction from the centre (`binding="direction"`, for fruits and whatever
else is seen whole from its centre), where the displacement also grows with the distance from the centre.

Wrinkles finer than the mesh's own triangles cannot be shown by it; `Bound.gap` says how far its vertices lie from the
surface that moves them, and `Bound.coarseness` how long its edges are beside the result's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from solver.arrays import Array, Ints
from solver.geometry.nearest import nearest
from sweeps import foreign, meshparts
from sweeps.errors import SweepError
from sweeps.foreign import KINDS

from ..errors import InvalidQuery, Unavailable, UnfitFormat, Wrong

if TYPE_CHECKING:
    from .view import Sequence, Surface

__all__ = ["KINDS", "Bound", "bind", "load"]


Binding = Literal["nearest", "direction"]
Fit = Literal["box", "none"]


@dataclass(frozen=True, eq=False)
class Bound:
    """A mesh (v, 3) tied to a surface: triangle (v), shares of its corners (v, 3), gain of the displacement (v).

    scale: units of the result per unit of the mesh. gap: distances (v) from the surface, in the result's units.
    coarseness: median edge of the mesh over that of the result.
    """

    points: Array
    corners: Ints
    shares: Array
    gain: Array
    scale: float
    gap: Array
    coarseness: float
    rest: Array

    def moved(self, surface: Surface) -> Array:
        """Return the mesh's vertices (v, 3), in its own units, as a stage of the result moves them."""
        displacement = surface.vertices.astype(float) - self.rest
        here = np.einsum("vk,vkc->vc", self.shares, displacement[self.corners])
        found: Array = self.points + self.gain[:, None] * here / self.scale
        return found

    def report(self) -> dict[str, float]:
        """Return how well the mesh lies on the surface, over the surface's own size."""
        size = float(np.linalg.norm(np.ptp(self.rest, axis=0)))
        return {
            "scale": self.scale,
            "gap_rms": float(np.sqrt(np.mean(self.gap**2)) / size),
            "gap_max": float(self.gap.max() / size),
            "coarseness": self.coarseness,
        }


def load(path: Path) -> tuple[Array, Array]:
    """Return (vertices (v, 3), triangles (f, 3)) of a mesh file, vertices in the file's own order.

    Raises:
        InvalidQuery: no such kind of file, or nothing that can be read in it.
        Unavailable: trimesh is not installed.

    """
    try:
        if path.suffix.lower() == ".obj":
            # trimesh splits vertices along texture seams, and a cache counts those of the file
            points, faces = _obj(path)
        else:
            mesh = foreign.read(path)
            points, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
        foreign.sound(path, points, faces)
    except foreign.NoReader as error:
        raise Unavailable(error.message, advice=error.advice) from None
    except SweepError as error:
        raise InvalidQuery.of([Wrong("mesh", error.message.rstrip("."), error.advice)]) from None
    return points, faces


def _obj(path: Path) -> tuple[Array, Array]:
    try:
        parts = meshparts.obj(foreign.checked(path).decode(errors="replace"))
    except (ValueError, IndexError) as error:
        raise foreign.ForeignMesh(path, str(error)[:200]) from None
    return parts.points, parts.faces


def bind(
    points: Array, triangles: Array, sequence: Sequence, binding: Binding | None = None, fit: Fit = "box"
) -> Bound:
    """Tie a mesh (v, 3), (f, 3) to the first stage of a sequence. Lattices bind by direction unless told otherwise.

    Raises:
        UnfitFormat: the result's triangles change.
        InvalidQuery: the mesh has no size, or a vertex in its very centre that no direction finds.

    """
    if not sequence.stays:
        raise UnfitFormat(
            "a mesh can be moved by triangles that stay, and this result's change from stage to stage.",
            advice="Ask for animation, usdc or ply-zip without a mesh.",
        )
    first = next(iter(sequence.at(0)))
    rest = first.vertices.astype(float)
    binding = binding or ("direction" if sequence.lattice else "nearest")
    low, high = rest.min(axis=0), rest.max(axis=0)
    scale, shift = 1.0, np.zeros(3)
    if fit == "box":
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        if size == 0:
            raise InvalidQuery.of([Wrong("mesh", "all vertices are in one place", "Give a mesh with some extent.")])
        scale = float(np.linalg.norm(high - low)) / size
        shift = (low + high) / 2 - scale * (points.min(axis=0) + points.max(axis=0)) / 2
    laid = scale * points + shift
    if binding == "nearest":
        found = nearest(laid, rest, first.triangles)
        gain, gap = np.ones(len(laid)), found.distance
    else:
        centre = np.zeros(3) if sequence.lattice else (low + high) / 2
        away, reach = laid - centre, rest - centre
        far = np.linalg.norm(away, axis=1)
        if far.min() < 1e-9 * far.max():
            advice = "Bind by the nearest place, or move that vertex."
            raise InvalidQuery.of([Wrong("mesh", "a vertex lies in the centre, where it has no direction", advice)])
        found = nearest(away / far[:, None], reach / np.linalg.norm(reach, axis=1, keepdims=True), first.triangles)
        below = np.linalg.norm(np.einsum("vk,vkc->vc", found.shares, reach[first.triangles[found.face]]), axis=1)
        gain, gap = far / below, np.abs(far - below)
    corners = first.triangles[found.face].astype(np.int64)
    coarseness = _edge(laid, triangles) / _edge(rest, first.triangles)
    return Bound(points, corners, found.shares, gain, scale, gap, coarseness, rest)


def _edge(points: Array, triangles: Array) -> float:
    return float(np.median(np.linalg.norm(points[triangles] - points[np.roll(triangles, 1, axis=1)], axis=2)))
