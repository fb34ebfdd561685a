"""What lies near each other along the sheet at rest, and how flat the sheet is there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from ...arrays import Bools, Floats, Ints
from ..topology import Topology

__all__ = ["Near", "flat", "near_of"]

#: Ways along edges are longer than those across triangles by at most about this.
_DETOUR = 1.2
#: Least cosine of a near normal, and of a triangle's normal at its corner, where a sheet cannot meet what is near it.
_COSINE, _SPREAD = 0.4, 0.7


@dataclass(frozen=True, eq=False)
class Near:
    """Vertices near each vertex along the rest state, in CSR, and what each vertex owns.

    start (n + 1,), other, way: near vertices and ways to them. altitudes (n,): least altitude of a rest triangle there.
    faces, edges: (start, which) of what a vertex is the lowest of. areas (n,). limit: longest way that counts.
    """

    start: Ints
    other: Ints
    way: Floats
    altitudes: Floats
    face_start: Ints
    edge_start: Ints
    faces: Ints
    edges: Ints
    areas: Floats
    limit: float

    def within(self, share: float) -> Near:
        """Return what is as near as a share of the limit."""
        kept = self.way <= share * self.limit
        start = np.concatenate([[0], np.cumsum(kept)])[self.start]
        return replace(self, start=start, other=self.other[kept], way=self.way[kept], limit=share * self.limit)

    def holds(self, pairs: Ints) -> Bools:
        """Return of which pairs (m, 2) of vertices the second is near the first."""
        n = len(self.start) - 1
        keys = np.repeat(np.arange(n), np.diff(self.start)) * n + self.other
        found: Bools = np.isin(pairs @ np.array([n, 1]), keys)
        return found


def near_of(
    metrics: tuple[Floats, ...],
    mesh: Topology,
    lengths: Floats,
    areas: Floats,
    distance: float,
    share: float = 1.0,
    rows: Bools | None = None,
) -> Near:
    """Return what is near: by metrics (f, 3), the least altitude of which counts, lengths of edges (e,), areas (n,).

    What is not near is at least `distance` away at rest. share: of the longest ways that count, which to go. rows (n,):
    vertices from which, if not from all.
    """
    n = mesh.vertices
    limit = share * _DETOUR * (distance + 2 * float(lengths.max()))
    asked = np.ones(n, np.bool_) if rows is None else rows
    ends = np.concatenate([mesh.edges, mesh.edges[:, ::-1]])
    order = np.argsort(ends[:, 0], kind="stable")
    indptr = np.searchsorted(ends[order, 0], np.arange(n + 1))
    start, other, way = _ways(indptr, ends[order, 1], np.concatenate([lengths, lengths])[order], limit, asked)
    altitudes = np.full(n, np.inf)
    for g in metrics:
        squares = np.maximum(np.maximum(g[:, 0], g[:, 2]), g[:, 0] + g[:, 2] - 2 * g[:, 1])
        # a triangle that has collapsed may be less than flat by rounding
        heights = np.sqrt(np.maximum(g[:, 0] * g[:, 2] - g[:, 1] ** 2, 0.0) / squares)
        for corner in range(3):
            np.minimum.at(altitudes, mesh.triangles[:, corner], heights)
    owners = mesh.triangles.min(axis=1)
    faces = np.argsort(owners, kind="stable")
    return Near(
        start,
        other,
        way,
        altitudes,
        np.searchsorted(owners[faces], np.arange(n + 1)),
        # edges are sorted by their lower vertex
        np.searchsorted(mesh.edges[:, 0], np.arange(n + 1)),
        mesh.triangles[faces],
        mesh.edges,
        areas,
        limit,
    )


@njit(cache=True, error_model="numpy")
def _ways(indptr: Ints, indices: Ints, lengths: Floats, limit: float, rows: Bools) -> tuple[Ints, Ints, Floats]:
    """Return the shortest ways along edges up to a limit, from some vertices, in CSR: a queue until nothing gains."""
    n = len(indptr) - 1
    start = np.zeros(n + 1, np.int64)
    room, gone, left = 1 << 14, 0, int(rows.sum())
    other, way = np.empty(room, np.int64), np.empty(room)
    found = np.full(n, np.inf)
    queue, waits, seen = np.empty(n, np.int64), np.zeros(n, np.bool_), np.empty(n, np.int64)
    count = 0
    for v in range(n):
        start[v + 1] = count
        if not rows[v]:
            continue
        found[v] = 0.0
        queue[0] = v
        first, waiting, known = 0, 1, 1
        seen[0] = v
        while waiting:
            i = queue[first]
            first = (first + 1) % n
            waiting -= 1
            waits[i] = False
            for e in range(indptr[i], indptr[i + 1]):
                j, length = indices[e], found[i] + lengths[e]
                if length < found[j] and length <= limit:
                    if found[j] == np.inf:
                        seen[known] = j
                        known += 1
                    found[j] = length
                    if not waits[j]:
                        waits[j] = True
                        queue[(first + waiting) % n] = j
                        waiting += 1
        gone += 1
        if count + known > room:
            # what has been found so far tells of the rest: new pages of memory cost more than the ways in them
            room = known + max(room + room // 2, (count + known) // gone * left * 9 // 8)
            more, further = np.empty(room, np.int64), np.empty(room)
            more[:count], further[:count] = other[:count], way[:count]
            other, way = more, further
        for k in range(known):
            j = seen[k]
            if j != v:
                other[count], way[count] = j, found[j]
                count += 1
            found[j] = np.inf
        start[v + 1] = count
    return start, other[:count], way[:count]


@njit(cache=True, error_model="numpy")
def flat(x: Floats, triangles: Ints, start: Ints, other: Ints) -> Bools:
    """Return about which vertices (n,) the sheet is flat enough not to meet itself within what is near."""
    n = len(start) - 1
    normals, units = np.zeros((n, 3)), np.empty((len(triangles), 3))
    for t in range(len(triangles)):
        i, j, k = triangles[t]
        a0, a1, a2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        b0, b1, b2 = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        c0, c1, c2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        size = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2) + 1e-300
        units[t, 0], units[t, 1], units[t, 2] = c0 / size, c1 / size, c2 / size
        for v in (i, j, k):
            normals[v, 0] += c0
            normals[v, 1] += c1
            normals[v, 2] += c2
    for v in range(n):
        normals[v] /= np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2) + 1e-300
    even = np.ones(n, np.bool_)
    for t in range(len(triangles)):
        for v in triangles[t]:
            if units[t, 0] * normals[v, 0] + units[t, 1] * normals[v, 1] + units[t, 2] * normals[v, 2] < _SPREAD:
                even[v] = False
    found = even.copy()
    for v in range(n):
        if not found[v]:
            continue
        for at in range(start[v], start[v + 1]):
            w = other[at]
            dot = normals[v, 0] * normals[w, 0] + normals[v, 1] * normals[w, 1] + normals[v, 2] * normals[w, 2]
            if dot < _COSINE or not even[w]:
                found[v] = False
                break
    return found
