"""The fruit's volume as tetrahedra: twenty cones over an icosahedron's faces, each cut as Freudenthal cuts a simplex.

A cone O A B C holds the lattice points k >= a >= b >= c >= 0 at O + a (A-O)/k + b (B-A)/k + c (C-B)/k, and the unit
cubes' six Kuhn simplices that keep the order. Corners are taken in the order of their numbers, so that neighbouring
cones cut their common face alike. Shell a is laid on a fraction of the way from the centre to the skin: nothing can
invert in a fruit that its centre sees whole, and one shell is the stone's surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations

import numpy as np

from ...arrays import Bools, Floats, Ints
from ...contract import InvalidGeometry
from ...fruit import Fruit
from ..surfaces.surface import GOLDEN_ICOSAHEDRON, GOLDEN_POINTS

__all__ = ["Solid", "ball", "fill", "volumes"]


@dataclass(frozen=True, eq=False)
class Solid:
    """Tetrahedra of a fruit.

    points (p, 3) [r1]; tets (t, 4) of positive volume; volume (t) [r1^3]; stone (t): whether a tetrahedron is stone.
    rays (p, 3): unit directions of the parametric sphere, 0 at the centre; depth (p): distance under the skin [r1].
    skin (s): numbers of the points on the surface; faces (f, 3): its triangles, wound outwards, numbered within `skin`.
    """

    points: Floats
    tets: Ints
    volume: Floats
    stone: Bools
    rays: Floats
    depth: Floats
    skin: Ints
    faces: Ints


def volumes(points: Floats, tets: Ints) -> Floats:
    """Return the signed volumes (t) of tetrahedra."""
    a, b, c = (points[tets[:, k]] - points[tets[:, 0]] for k in (1, 2, 3))
    found: Floats = np.einsum("ti,ti->t", np.cross(a, b), c) / 6
    return found


def fill(fruit: Fruit, layers: int) -> Solid:
    """Return the fruit's volume in so many shells: about 10/3 layers^3 points and 20 layers^3 tetrahedra.

    Raises:
        InvalidGeometry: a tetrahedron has no positive volume.

    """
    rays, shell, tets, skin, faces = ball(layers)
    theta = np.arccos(np.clip(rays[:, 1], -1, 1))
    outside = fruit.surface(theta, np.arctan2(rays[:, 2], rays[:, 0]))
    distance = np.linalg.norm(outside, axis=1)
    hard = np.zeros(len(tets), np.bool_)
    along = shell / layers
    if fruit.has_stone:
        edge = fruit.stone_distance(outside / distance[:, None]) / distance
        last = int(np.clip(round(layers * float(edge.mean())), 1, layers - 1))
        inner, outer = along * layers / last * edge, edge + (1 - edge) * (shell - last) / (layers - last)
        along = np.where(shell <= last, inner, outer)
        hard = shell[tets].max(axis=1) <= last
    points = outside * along[:, None]
    volume = volumes(points, tets)
    if not volume.min() > 0:
        raise InvalidGeometry(
            "the fruit's volume cannot be cut into tetrahedra along rays from its centre.",
            advice="Bring neighbouring radii closer, or ask for a better quality.",
        )
    return Solid(points, tets, volume, hard, rays, distance * (1 - along), skin, faces)


@lru_cache(maxsize=4)
def ball(k: int) -> tuple[Floats, Ints, Ints, Ints, Ints]:
    """Return rays (p, 3), shells (p), tets (t, 4), skin (s) and faces (f, 3) of a ball of k shells."""
    cones = np.sort(np.array(GOLDEN_ICOSAHEDRON).reshape(20, 3), axis=1)
    a, b, c = (g.ravel() for g in np.meshgrid(*[np.arange(k + 1)] * 3, indexing="ij"))
    kept = (a >= b) & (b >= c)
    place = np.full((k + 2,) * 3, -1)
    sites = np.stack([a, b, c], axis=1)[kept]
    place[tuple(sites.T)] = np.arange(len(sites))
    simplices = []
    for order in permutations(range(3)):
        corners = [sites]
        for axis in order:
            corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
        numbers = np.stack([place[tuple(corner.T)] for corner in corners], axis=1)
        simplices.append(numbers[numbers.min(axis=1) >= 0])
    cut = np.concatenate(simplices)
    shares = np.zeros((20, len(sites), 12), np.int16)
    for cone, corners in zip(shares, cones, strict=True):
        cone[:, corners] = np.stack([sites[:, 0] - sites[:, 1], sites[:, 1] - sites[:, 2], sites[:, 2]], axis=1)
    unique, back = np.unique(shares.reshape(-1, 12), axis=0, return_inverse=True)
    rays = unique @ GOLDEN_POINTS
    length = np.linalg.norm(rays, axis=1, keepdims=True)
    rays = np.where(length > 0, rays / np.maximum(length, 1e-300), 0.0)
    shell = unique.sum(axis=1).astype(np.int64)
    tets = (back.reshape(20, -1)[:, cut]).reshape(-1, 4)
    points = rays * shell[:, None]
    turned = volumes(points, tets) < 0
    tets[turned, 2:] = tets[turned, :1:-1]
    # a face of the surface is what three corners on the last shell span
    on = shell[tets] == k
    three = on.sum(axis=1) == 3
    faces = tets[three][on[three]].reshape(-1, 3)
    normal = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    inward = np.einsum("fi,fi->f", normal, points[faces[:, 0]]) < 0
    faces[inward] = faces[inward][:, ::-1]
    skin = np.flatnonzero(shell == k)
    number = np.full(len(rays), -1)
    number[skin] = np.arange(len(skin))
    for array in (rays, shell, tets, skin):
        array.flags.writeable = False
    return rays, shell, tets.astype(np.int64), skin, number[faces]
