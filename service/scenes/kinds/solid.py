"""A triangle mesh of its own, coarsened to levels of detail.

Coarser levels are meshoptimizer's: edges are collapsed onto vertices that are there, where position and colour suffer
least (Garland and Heckbert 1997; Hoppe 1999 for colours), so that a vertex of any level is one of the mesh, and later
stages that keep its triangles are coarsened alike. Meshes of many parts are clustered where that leaves far too much.
Without that package there is one level, the mesh itself.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from solver.arrays import Array, Floats

from ...formats.mesh import is_open
from ...limits import waited
from .kind import RUNGS

__all__ = ["Level", "Solid"]

#: Weight of a colour's error beside that of a position over the mesh's size.
_COLOURS = 0.3
#: How far a coarser mesh may be off before it may have more triangles than asked for, over its size; how many times as
#: many, before parts are melted together; and the fewest that still show something.
_WORST, _MORE, _LEAST = 0.1, 4, 8
#: Largest angle [radian] between corners of a triangle as the middle sees them, when its outline is sampled.
_FINE, _HALVINGS = 0.09, 24


class Level(NamedTuple):
    """Numbers of the vertices that are left (v), their triangles (f, 3), and how far they are off, over the size."""

    vertices: Array
    triangles: Array
    error: float


@dataclass(eq=False)
class Solid:
    """Stages of one mesh about its origin: points and normals (v, 3), triangles (f, 3), and colours (v, 3): of every
    stage, or of the first alone where they stay. The first `own` triangles are its body; others stand on it.
    """

    stages: tuple[tuple[Array, Array], ...]
    triangles: Array
    colours: tuple[Floats, ...]
    own: int | None = None
    levels: dict[int, Level] = field(default_factory=dict)

    def under(self, others: Sequence[tuple[Array, Array, Array, Array]]) -> Solid:
        """Return it with meshes (points, normals, triangles, colours) that stand on its one stage."""
        if not others:
            return self
        (points, normal), (colour,) = self.stages[0], self.colours
        count, faces = len(points), [self.triangles]
        for more in others:
            faces.append(np.asarray(more[2], np.int64) + count)
            count += len(more[0])
        joined = (np.concatenate([mine, *(more[k] for more in others)]) for k, mine in ((0, points), (1, normal)))
        shown = np.concatenate([colour, *(more[3] for more in others)])
        return Solid((tuple(joined),), np.concatenate(faces), (shown,), len(self.triangles))  # type: ignore[arg-type]

    @property
    def _body(self) -> Array:
        """The triangles of its body."""
        return self.triangles[: self.own]

    @property
    def points(self) -> Array:
        """Those of the first stage."""
        return self.stages[0][0]

    @cached_property
    def finest(self) -> int:
        """The level that is the mesh itself."""
        return int(RUNGS[min(int(np.searchsorted(4 * RUNGS**2, len(self.triangles))), len(RUNGS) - 1)])

    def level(self, n: int) -> Level:
        """Return the mesh with 4 n^2 triangles, or as few as its seams and holes allow."""
        if n not in self.levels:
            waited.check()
            self.levels[n] = self._level(n)
        return self.levels[n]

    def _level(self, n: int) -> Level:
        try:
            import meshoptimizer
        except ImportError:
            return Level(np.arange(len(self.points)), self.triangles, 0.0)
        triangles, error = self.triangles, 0.0
        if len(triangles) > 4 * n * n:
            triangles, error = self._coarser(meshoptimizer, 4 * n * n)
        flat = np.ascontiguousarray(triangles.ravel(), np.uint32)
        ordered = np.empty_like(flat)
        meshoptimizer.optimize_vertex_cache(ordered, flat, len(flat), len(self.points))
        # vertices in the order in which triangles want them, which packs best
        used, first, inverse = np.unique(ordered, return_index=True, return_inverse=True)
        order = np.argsort(first, kind="stable")
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        return Level(used[order].astype(np.int64), rank[inverse].reshape(-1, 3), error)

    def _coarser(self, library: ModuleType, count: int) -> tuple[Array, float]:
        flat = np.ascontiguousarray(self.triangles.ravel(), np.uint32)
        out, error = np.empty_like(flat), np.zeros(1, np.float32)
        # as eyes tell colours apart, not as light adds up; the last stage's as much as the first's
        ends = np.concatenate([self.colours[0], self.colours[-1]][: len(self.colours)], axis=1)
        seen = np.ascontiguousarray(np.sqrt(np.clip(ends, 0, 1)), np.float32)
        points = np.ascontiguousarray(self.points, np.float32)
        size = ctypes.c_size_t  # the package does not say of what types these are, so numbers must
        left = library.simplify_with_attributes(
            out,
            flat,
            points,
            seen,
            np.full(seen.shape[1], _COLOURS, np.float32),
            index_count=size(len(flat)),
            vertex_count=size(len(points)),
            vertex_positions_stride=size(points.strides[0]),
            vertex_attributes_stride=size(seen.strides[0]),
            attribute_count=size(seen.shape[1]),
            target_index_count=size(int(3 * count)),
            target_error=ctypes.c_float(_WORST),
            options=ctypes.c_uint(library.SIMPLIFY_PRUNE),
            result_error=error,
        )
        if left > 3 * _MORE * count:
            # many small parts with seams: of what is so small on the screen, only where it is counts
            loose, other = np.empty_like(flat), np.zeros(1, np.float32)
            least = library.simplify_sloppy(
                loose, flat, points, target_index_count=int(3 * count), target_error=1.0, result_error=other
            )
            if 3 * _LEAST <= least < left:
                out, left, error = loose, least, other
        return out[:left].reshape(-1, 3).astype(np.int64), float(error[0])

    @cached_property
    def outline(self) -> Floats:
        """Corners (v, 3) of the convex hulls of all stages."""
        found = []
        for points, _ in self.stages:
            try:
                found.append(points[ConvexHull(points).vertices])
            except QhullError:  # flat
                found.append(points)
        return np.concatenate(found).astype(float)

    @cached_property
    def is_open(self) -> bool:
        """Whether it has a rim, so that its inside may be seen."""
        return is_open(self.points, self._body)

    def holds(self, point: Floats) -> bool:
        """Return whether a point (3) is inside: the solid angles of the triangles add up to more than half."""
        a, b, c = (self.points[self._body[:, k]].astype(float) - point for k in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        over = np.einsum("ij,ij->i", a, np.cross(b, c))
        below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        # van Oosterom and Strackee 1983
        return abs(float(np.arctan2(over, below).sum()) / (2 * np.pi)) > 0.5

    @cached_property
    def around(self) -> Floats:
        """Points (p, 3) of the surface, as near to each other as the origin can tell: what a pile takes it for."""
        corners = self.points[self._body].astype(float)
        found = [corners.reshape(-1, 3)]
        for _ in range(_HALVINGS):
            away = corners / np.maximum(np.linalg.norm(corners, axis=2, keepdims=True), 1e-300)
            sides = np.linalg.norm(away - np.roll(away, -1, axis=1), axis=2)
            wide = sides.max(axis=1) > _FINE
            if not wide.any():
                break
            corners, side = corners[wide], sides[wide].argmax(axis=1)
            row = np.arange(len(corners))
            a, b, c = (corners[row, (side + k) % 3] for k in range(3))
            middle = 0.5 * (a + b)
            found.append(middle)
            corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        points = np.concatenate(found)
        return np.asarray(points[np.linalg.norm(points, axis=1) > 1e-9 * np.abs(points).max()])
