"""The fruit's surface as triangles: a geodesic sphere laid on it, lumped areas and a Laplacian with no negative weight.

The cotangent Laplacian of the intrinsic Delaunay triangulation (Sharp and Crane 2020, package `robust_laplacian`) keeps
the maximum principle on obtuse triangles too: a flux always runs from much to little. Second order on smooth fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import robust_laplacian
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.spatial import KDTree

from ...arrays import Bools, Floats, Ints
from ...contract import InvalidGeometry
from ...fruit import Fruit, directions, lattice

__all__ = [
    "GOLDEN_ICOSAHEDRON",
    "GOLDEN_POINTS",
    "Extent",
    "Surface",
    "extent",
    "geodesic",
    "lay",
    "sampler",
    "shares_at",
    "triangulated",
]


_GOLDEN = (1 + 5**0.5) / 2
#: Corners of its triangles, of three golden rectangles of four corners each.
GOLDEN_ICOSAHEDRON = (
    *(0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8),
    *(3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1),
)
_RECTANGLE = np.array([[-1, _GOLDEN, 0], [1, _GOLDEN, 0], [-1, -_GOLDEN, 0], [1, -_GOLDEN, 0]])
#: Its corners (12, 3), of length 1.
GOLDEN_POINTS: Floats = np.concatenate([np.roll(_RECTANGLE, k, axis=1) for k in range(3)]) / np.hypot(1, _GOLDEN)


class Extent(NamedTuple):
    """Area [r1^2] and volume [r1^3] of a fruit."""

    area: float
    volume: float


@dataclass(frozen=True, eq=False)
class Surface:
    """Points (v, 3) and faces (f, 3) of a surface [r1] with its discrete Laplacian.

    area: lumped area of each vertex (v) [r1^2]. start, near, weight: neighbours of vertex i and the weights of the
    edges to them are near[start[i]:start[i+1]] and weight[...] (compressed rows, without the diagonal), symmetric.
    stiffest: upper bound of the spectral radius of the Laplacian with unit diffusivity [1/r1^2] (Gershgorin).
    """

    points: Floats
    faces: Ints
    area: Floats
    start: Ints
    near: Ints
    weight: Floats
    stiffest: float

    @property
    def skin(self) -> Surface:
        """What of it is surface, whose points come first: all."""
        return self

    def mean(self, field: Floats | Bools) -> float:
        """Return the area-weighted mean of a field (v)."""
        return self.total(field) / self.total(1.0)

    def total(self, field: Floats | Bools | float) -> float:
        """Return the integral over the surface of a field (v) [r1^2]; the same whatever the number of threads."""
        return float(np.sum(self.area * field))  # a BLAS product would sum by threads


@lru_cache(maxsize=4)
def geodesic(cells: int) -> tuple[Floats, Ints]:
    """Return unit directions (10 cells^2 + 2, 3) and faces (20 cells^2, 3), wound outwards, of a geodesic sphere.

    cells: edges along one of the icosahedron's. Its triangles are cut evenly by the odd part of the number, then
    halved: a sphere of twice the cells has all points of this one. Neighbours lie close in memory.
    """
    halvings = (cells & -cells).bit_length() - 1
    points, faces = _cut(cells >> halvings)
    for _ in range(halvings):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, back = np.unique(edges[:, 0] * len(points) + edges[:, 1], return_inverse=True)
        middle = points[unique // len(points)] + points[unique % len(points)]
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        a, b, c = back.reshape(3, -1) + len(points)
        p, q, r = faces.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((p, a, c), (q, b, a), (r, c, b), (a, b, c))])
        points = np.concatenate([points, middle])
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    graph = sparse.csr_matrix((np.ones(len(ends)), ends.T), shape=(len(points),) * 2)
    order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    points, faces = points[order], place[faces]
    points.flags.writeable = faces.flags.writeable = False
    return points, faces


def _cut(cells: int) -> tuple[Floats, Ints]:
    """Return the icosahedron, each triangle cut evenly into cells^2 and its points put on the sphere."""
    faces = np.array(GOLDEN_ICOSAHEDRON).reshape(20, 3)
    if cells == 1:
        return GOLDEN_POINTS, faces
    number: dict[tuple[tuple[int, int], ...], int] = {}
    cut = []
    for corners in faces.tolist():

        def at(i: int, j: int, corners: list[int] = corners) -> int:
            # neighbours name a point of their common edge alike: by its corners and their shares
            shares = zip(corners, (cells - i - j, i, j), strict=True)
            return number.setdefault(tuple(sorted((c, s) for c, s in shares if s)), len(number))

        for i in range(cells):
            for j in range(cells - i):
                cut.append((at(i, j), at(i + 1, j), at(i, j + 1)))
                if i + j < cells - 1:
                    cut.append((at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)))
    points = np.array([sum(GOLDEN_POINTS[c] * s for c, s in shares) for shares in number])
    return points / np.linalg.norm(points, axis=1, keepdims=True), np.array(cut)


def triangulated(points: Floats, faces: Ints) -> Surface:
    """Return the surface of a triangle mesh, closed or open: nothing flows over an open border.

    Raises:
        InvalidGeometry: no triangle, or a point that no triangle of positive area touches.

    """
    if len(points) == 0 or len(faces) == 0:
        raise InvalidGeometry("the surface has no triangles.", advice="Give a mesh with at least one triangle.")
    laplacian, area = _cotangents(points, faces) or _robust(points, faces)
    if not np.isfinite(area).all() or area.min() <= 0:
        raise InvalidGeometry(
            "the surface has points that no triangle of positive area touches.", advice="Remove unused points."
        )
    links = laplacian.tocoo()
    kept = links.row != links.col
    rows = sparse.csr_array(
        (np.maximum(-links.data[kept], 0), (links.row[kept], links.col[kept])), shape=laplacian.shape
    )
    rows = ((rows + rows.T) / 2).tocsr()
    rows.sort_indices()
    return Surface(
        points,
        faces,
        area,
        rows.indptr.astype(np.int64),
        rows.indices.astype(np.int64),
        rows.data,
        float((2 * rows.sum(axis=1) / area).max()),
    )


def _cotangents(points: Floats, faces: Ints) -> tuple[Any, Floats] | None:
    """Return Laplacian and lumped areas (v) of a mesh whose own triangles are Delaunay; None of any other."""
    count = len(points)
    rows, columns, values = [], [], []
    doubled = np.linalg.norm(
        np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]), axis=1
    )
    if not doubled.min() > 0:
        return None
    for k in range(3):
        o, i, j = (faces[:, (k + m) % 3] for m in range(3))
        rows.append(np.minimum(i, j))
        columns.append(np.maximum(i, j))
        # the angle across from the edge
        values.append(np.einsum("fk,fk->f", points[i] - points[o], points[j] - points[o]) / (2 * doubled))
    edge = np.concatenate(rows) * count + np.concatenate(columns)
    edges, back, uses = np.unique(edge, return_inverse=True, return_counts=True)
    weight = np.bincount(back, np.concatenate(values))
    if weight.min() < 0 or uses.max() > 2:
        return None
    i, j = edges // count, edges % count
    both = (np.concatenate([i, j]), np.concatenate([j, i]))
    laplacian = sparse.coo_array((-np.concatenate([weight, weight]), both), shape=(count, count))
    return laplacian, np.bincount(faces.ravel(), np.repeat(doubled / 6, 3), count).astype(float)


def _robust(points: Floats, faces: Ints) -> tuple[Any, Floats]:
    laplacian, mass = robust_laplacian.mesh_laplacian(np.asarray(points, float), np.asarray(faces, np.int64))
    return laplacian, mass.diagonal()


def lay(fruit: Fruit, cells: int) -> Surface:
    """Return the fruit's fresh outer surface as a geodesic sphere of so many `cells` laid on it."""
    return triangulated(_laid(fruit, cells), geodesic(cells)[1])


def _laid(fruit: Fruit, cells: int) -> Floats:
    rays, _ = geodesic(cells)
    return fruit.surface(np.arccos(np.clip(rays[:, 1], -1, 1)), np.arctan2(rays[:, 2], rays[:, 0]))


def extent(fruit: Fruit) -> Extent:
    """Return area and volume of the fresh fruit, from two coarse spheres: the error of order two cancels."""
    coarse, fine = (_facets(_laid(fruit, cells), geodesic(cells)[1]) for cells in (16, 32))
    return Extent(*((4 * fine - coarse) / 3).tolist())


def _facets(points: Floats, faces: Ints) -> Floats:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.array([np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2, np.sum(a * np.cross(b, c)) / 6])


@lru_cache(maxsize=4)
def sampler(cells: int, resolution: int) -> sparse.csr_array:
    """Return the matrix that takes a field on `geodesic(cells)` to the common lattice (n * 2n rows), linearly."""
    return shares_at(*geodesic(cells), directions(*lattice(resolution)).reshape(-1, 3))


def shares_at(rays: Floats, faces: Ints, wanted: Floats) -> sparse.csr_array:
    """Return the matrix (w rows) that takes a field on a triangulated sphere of unit rays to wanted rays (w, 3)."""
    corners = rays[faces]
    _, candidates = KDTree(corners.mean(axis=1)).query(wanted, k=4)
    best, weights = np.full(len(wanted), -np.inf), np.zeros((len(wanted), 3))
    face = np.zeros(len(wanted), np.int64)
    for column in np.asarray(candidates).T:
        # the ray through the face's plane, as shares of its corners
        shares = np.linalg.solve(np.swapaxes(corners[column], 1, 2), wanted[..., None])[..., 0]
        shares /= shares.sum(axis=1, keepdims=True)
        inside = shares.min(axis=1)
        better = inside > best
        best[better], weights[better], face[better] = inside[better], shares[better], column[better]
    weights = np.clip(weights, 0, None)
    weights /= weights.sum(axis=1, keepdims=True)
    index = (np.repeat(np.arange(len(wanted)), 3), faces[face].ravel())
    return sparse.csr_array((weights.ravel(), index), shape=(len(wanted), len(rays)))
