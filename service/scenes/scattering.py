"""Scattering over a mesh: individuals stand on its triangles along their normals, as many as the area asks for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from solver import resting
from solver.arrays import Array, Floats

from ..limits import waited
from .ground import Ground, across

if TYPE_CHECKING:
    from .kinds import Kind
    from .placing import Instances

__all__ = ["scatter"]

#: How many places are tried for each individual before a mesh is called too small.
_TRIES = 200
#: Cells are as wide as two of the largest feet in them, and some more for what is rounded; feet so many times smaller
#: have cells of their own. No cell is finer than this share of the mesh's largest coordinate.
_WIDER, _STEP, _FINEST = 2.001, 4.0, 1e-9
_AROUND = tuple(itertools.product((0, -1, 1), repeat=3))


def scatter(ground: Ground, seed: int, found: Instances, kinds: Sequence[Kind]) -> resting.Rest:
    """Stand individuals on a mesh: places by area, their own y along the triangle's normal, turned about it by chance.

    Feet are apart: no two circles that hold what is above them overlap. An individual's lowest point touches the plane
    of its triangle.

    Raises:
        ValueError: there is no room for all.

    """
    random, count = np.random.default_rng(seed), len(found.kind)
    points, faces = ground.arrays
    normals = across(points, faces)
    area = np.linalg.norm(normals, axis=1)
    foot, down = _feet(found, kinds)
    # the largest first: they find no room between small ones
    order = np.argsort(-foot, kind="stable")
    at, on = _apart(random, points, faces, area, foot[order])
    if len(at) < count:
        raise ValueError(
            f"{count} things with feet up to {2 * foot.max():.3g} across found room for {len(at)} on the mesh: "
            "take fewer, smaller ones, or a larger mesh"
        )
    centre, turn = np.empty((count, 3)), np.empty((count, 4))
    normal = normals[on] / area[on, None]
    centre[order] = at + normal * down[order, None]
    turn[order] = _standing(normal, random.uniform(0, 2 * np.pi, count))
    return resting.Rest(centre, turn, 0.0, True)


def _feet(found: Instances, kinds: Sequence[Kind]) -> tuple[Floats, Floats]:
    """Return how far each individual reaches from its own y axis, and below its middle [scene unit]."""
    wide, low = np.zeros(len(kinds)), np.zeros(len(kinds))
    for k in np.unique(found.kind):
        outline = kinds[k].outline
        wide[k], low[k] = np.hypot(outline[:, 0], outline[:, 2]).max(), -outline[:, 1].min()
    return wide[found.kind] * found.scale, low[found.kind] * found.scale


def _apart(
    random: np.random.Generator, points: Floats, faces: Array, area: Floats, foot: Floats
) -> tuple[Floats, Array]:
    """Return places (n, 3) and their triangles (n) for feet, the largest first, as many as find room."""
    at, on = np.empty((len(foot), 3)), np.empty(len(foot), np.int64)
    share, taken = np.cumsum(area) / area.sum(), 0
    feet = _Feet(float(np.abs(points).max()))
    for radius in foot:
        waited.check()
        for _ in range(_TRIES):
            triangle = min(int(np.searchsorted(share, random.random(), side="right")), len(faces) - 1)
            u, v = random.random(2)
            if u + v > 1:
                u, v = 1 - u, 1 - v
            a, b, c = points[faces[triangle]]
            place = a + u * (b - a) + v * (c - a)
            x, y, z = place.tolist()
            if feet.fits(x, y, z, float(radius)):
                at[taken], on[taken] = place, triangle
                taken += 1
                break
        else:
            break
    return at[:taken], on[:taken]


class _Feet:
    """Feet that stand already, by cells of about their size: a new one looks at those in the cells around it alone."""

    def __init__(self, extent: float) -> None:
        # so that no number of a cell is beyond what floats tell apart
        self._least = _FINEST * extent
        self._levels: list[tuple[float, dict[tuple[int, int, int], list[tuple[float, float, float, float]]]]] = []

    def fits(self, x: float, y: float, z: float, radius: float) -> bool:
        """Return whether a foot, no larger than those before, overlaps none of them; then it stands there as well."""
        for cell, feet in self._levels:
            i, j, k = math.floor(x / cell), math.floor(y / cell), math.floor(z / cell)
            for a, b, c in _AROUND:
                for p, q, r, other in feet.get((i + a, j + b, k + c), ()):
                    p, q, r, reach = p - x, q - y, r - z, other + radius
                    if p * p + q * q + r * r < reach * reach:
                        return False
        cell = max(_WIDER * radius, self._least)
        if not self._levels or cell < self._levels[-1][0] / _STEP:
            self._levels.append((cell, {}))
        cell, feet = self._levels[-1]
        place = math.floor(x / cell), math.floor(y / cell), math.floor(z / cell)
        feet.setdefault(place, []).append((x, y, z, radius))
        return True


def _standing(normal: Floats, angle: Floats) -> Floats:
    """Return quaternions (n, 4; x, y, z, w) that turn y into normals (n, 3), after a turn about y."""
    x, y, z = normal.T
    # the shortest arc from y; half a turn about x where the normal is -y
    arc = np.stack([z, np.zeros_like(x), -x, 1 + y], axis=1)
    arc[1 + y < 1e-9] = (1.0, 0.0, 0.0, 0.0)
    arc /= np.linalg.norm(arc, axis=1)[:, None]
    sin, cos = np.sin(angle / 2), np.cos(angle / 2)
    own = np.stack([np.zeros_like(sin), sin, np.zeros_like(sin), cos], axis=1)
    vector = arc[:, 3:] * own[:, :3] + own[:, 3:] * arc[:, :3] + np.cross(arc[:, :3], own[:, :3])
    real = arc[:, 3] * own[:, 3] - np.einsum("ij,ij->i", arc[:, :3], own[:, :3])
    return np.concatenate([vector, real[:, None]], axis=1)
