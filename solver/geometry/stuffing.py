"""Tetrahedra that fill a closed surface: isosurface stuffing (Labelle and Shewchuk 2007, doi:10.1145/1276377.1276448).

A body-centred cubic lattice is cut at the surface. Nodes nearer to a cut than a share of their edge are first moved
there, so that no sliver is left; the shares are the paper's, which bound all angles. What is cut are then pieces of
tetrahedra, each a prism or one with edges of no length, and a quadrilateral's diagonal starts at its first number, so
that neighbours cut it alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ..arrays import Bools, Floats, Ints
from .inside import inside
from .nearest import nearest

__all__ = ["Stuffed", "boundary", "pieces", "stuffed", "touched"]

#: Share of an edge along an axis, and of a diagonal one, within which a node moves to a cut (the paper's Table 1).
_LONG, _SHORT = 0.24999, 0.41189
#: Where the lattice starts, off any round number: lines through vertices and along edges are nothing to be rounded.
_OFF = np.array([0.137_041, 0.241_733, 0.189_337])


#: The most corners of cubes that a lattice is looked at for.
_NODES = 2e7
#: Corners of the three tetrahedra of a prism whose side away from its least corner is cut from 1 to 5, or from 2 to 4.
_WAYS = ([[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]], [[0, 1, 2, 4], [0, 4, 2, 5], [0, 4, 5, 3]])


class Stuffed(NamedTuple):
    """Points (p, 3), tetrahedra (t, 4) of positive volume."""

    points: Floats
    tets: Ints


def touched(points: Floats, faces: Ints, edge: float) -> float:
    """Return how many tetrahedra of the lattice that `stuffed` would lay have a node in a closed mesh (v, 3), (f, 3).

    Infinite where the lattice has more nodes than are looked at. Takes a hundredth of the time that `stuffed` does.
    """
    if np.prod(_count(points, edge)[1].astype(float)) > _NODES:
        return np.inf
    return float(sum(near.sum() for *_, near in _tetrahedra(*_grids(points, faces, edge)[1])))


def stuffed(points: Floats, faces: Ints, edge: float) -> Stuffed:
    """Return tetrahedra with axis edges of about `edge` in a closed mesh (v, 3), (f, 3); none if it is thinner."""
    low, grids = _grids(points, faces, edge)
    # what is as a whole outside is never laid, and its nodes neither: of a leaf that is nearly all of the lattice
    laid = np.concatenate([np.stack([each[near] for each in tets], axis=-1) for *tets, near in _tetrahedra(*grids)])
    used, tets = np.unique(laid, return_inverse=True)
    tets = tets.reshape(-1, 4)
    nodes, centred = low + edge * _places(used, *(grid.shape for grid in grids)), used >= grids[0].size
    within = np.concatenate([grid.ravel() for grid in grids])[used]
    mixed = np.unique(tets[within[tets].any(axis=1) & ~within[tets].all(axis=1)])
    level = np.where(within, np.inf, -np.inf)
    level[mixed] = np.where(within[mixed], 1.0, -1.0) * nearest(nodes[mixed], points, faces).distance
    moved, level = _warped(nodes, level, centred, _edges(tets))
    return _cut(moved, level, tets)


def _count(points: Floats, edge: float) -> tuple[Floats, Ints]:
    """Return where the lattice starts (3), and its corners along each axis (3)."""
    low, high = points.min(axis=0) - edge * (1 + _OFF), points.max(axis=0) + edge
    return low, np.ceil((high - low) / edge).astype(int) + 1


def _grids(points: Floats, faces: Ints, edge: float) -> tuple[Floats, list[Bools]]:
    """Return where the lattice starts (3), and which corners (i, j, k) and middles of its cubes are inside."""
    low, count = _count(points, edge)
    shapes = ((*count.tolist(),), (*(count - 1).tolist(),))
    return low, [inside(low + k * edge / 2, edge, shape, points, faces) for k, shape in enumerate(shapes)]


def _tetrahedra(corners: Bools, middles: Bools) -> Iterator[tuple[Ints, Ints, Ints, Ints, Bools]]:
    """Yield the four nodes, corners numbered before middles, of arrays of tetrahedra, and whether one is inside."""
    number = np.arange(corners.size).reshape(corners.shape)
    middle = corners.size + np.arange(middles.size).reshape(middles.shape)
    for axis in range(3):
        a, b, *ring = _around(number, middle, axis)
        in_a, in_b, *in_ring = _around(corners, middles, axis)
        for k, c in enumerate(ring):
            after = (k + 1) % 4
            yield a, b, c, ring[after], in_a | in_b | in_ring[k] | in_ring[after]


def _around(corners: Any, middles: Any, axis: int) -> list[Any]:
    """Return of values at the nodes, for each face between two cubes, those of both middles and its corners in turn."""
    middles, face = np.moveaxis(middles, axis, 0), np.moveaxis(corners, axis, 0)[1:-1]
    turn = [face[:, :-1, :-1], face[:, 1:, :-1], face[:, 1:, 1:], face[:, :-1, 1:]]
    return [middles[:-1], middles[1:], *turn]


def _places(nodes: Ints, corners: tuple[int, ...], middles: tuple[int, ...]) -> Floats:
    """Return where nodes (n) of a lattice with so many corners and middles are, in edges (n, 3)."""
    count = int(np.prod(corners))
    centred = nodes >= count
    return np.concatenate(
        [
            np.stack(np.unravel_index(nodes[~centred], corners), axis=-1) + 0.0,
            np.stack(np.unravel_index(nodes[centred] - count, middles), axis=-1) + 0.5,
        ]
    )


def _edges(tets: Ints) -> Ints:
    """Return the edges (e, 2) of tetrahedra, lesser node first, in order."""
    pairs = np.concatenate([tets[:, [i, j]] for i in range(4) for j in range(i + 1, 4)])
    # numbers are sorted ten times as fast as rows are, and twice as fast as they are hashed
    count = int(pairs.max(initial=0)) + 1
    keys = np.sort(pairs.min(axis=1) * count + pairs.max(axis=1))
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack(np.divmod(keys, count), axis=1)


def _warped(nodes: Floats, level: Floats, centred: Bools, edges: Ints) -> tuple[Floats, Floats]:
    """Return nodes moved onto cuts that are too near, and their levels, 0 where they moved."""
    edges = edges[level[edges].min(axis=1) * level[edges].max(axis=1) < 0]
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    first = np.searchsorted(both[:, 0], np.arange(len(nodes) + 1))
    moved, level = nodes.copy(), level.copy()
    _warp(nodes, level, centred, first, both[:, 1], moved, _LONG, _SHORT)
    return moved, level


@njit(cache=True, error_model="numpy")
def _warp(
    nodes: Floats, level: Floats, centred: Bools, first: Ints, to: Ints, moved: Floats, long: float, short: float
) -> None:
    for i in range(len(nodes)):
        best, there = np.inf, -1
        for k in range(first[i], first[i + 1]):
            j = to[k]
            if level[i] * level[j] >= 0:
                continue  # its other end has moved onto the surface
            share = level[i] / (level[i] - level[j])
            alike = centred[i] == centred[j]
            if share < (long if alike else short):
                # an axis edge is longer than a diagonal one by 2 over the root of 3
                far = share * (1.0 if alike else 0.8660254037844386)
                if far < best:
                    best, there = far, j
        if there >= 0:
            share = level[i] / (level[i] - level[there])
            for c in range(3):
                moved[i, c] = nodes[i, c] + share * (nodes[there, c] - nodes[i, c])
            level[i] = 0.0


def _cut(nodes: Floats, level: Floats, tets: Ints) -> Stuffed:
    """Return what of the tetrahedra lies above level 0."""
    tets = tets[(level[tets] > 0).any(axis=1)]
    below = (level[tets] < 0).sum(axis=1)
    edges = _edges(tets[below > 0])
    edges = edges[level[edges].min(axis=1) * level[edges].max(axis=1) < 0]
    share = (level[edges[:, 0]] / (level[edges[:, 0]] - level[edges[:, 1]]))[:, None]
    points = np.concatenate([nodes, nodes[edges[:, 0]] + share * (nodes[edges[:, 1]] - nodes[edges[:, 0]])])
    keys = edges[:, 0] * len(nodes) + edges[:, 1]

    def cut(i: Ints, j: Ints) -> Ints:
        """Return the cuts between corners i above and j below, i itself where it lies on the surface."""
        place = np.searchsorted(keys, np.minimum(i, j) * len(nodes) + np.maximum(i, j))
        return np.where(level[i] == 0, i, len(nodes) + place)

    parts = [tets[below == 0]]
    # corners from the lowest level to the highest
    order = np.argsort(level[tets], axis=1, kind="stable")
    tets = np.take_along_axis(tets, order, axis=1)
    one, two, three = (tets[below == k].T for k in (1, 2, 3))
    parts.append(_prisms(np.stack([*one[1:], *(cut(i, one[0]) for i in one[1:])], axis=1)))
    a, b, p, q = two
    parts.append(_prisms(np.stack([p, cut(p, a), cut(p, b), q, cut(q, a), cut(q, b)], axis=1)))
    a, b, c, p = three
    parts.append(np.stack([p, cut(p, a), cut(p, b), cut(p, c)], axis=1))
    whole = np.concatenate(parts)
    used, whole = np.unique(whole, return_inverse=True)
    points, whole = points[used], whole.reshape(-1, 4)
    a, b, c = (points[whole[:, k]] - points[whole[:, 0]] for k in (1, 2, 3))
    turned = np.einsum("ti,ti->t", np.cross(a, b), c) < 0
    whole[turned, 2:] = whole[turned, :1:-1]
    return Stuffed(points, whole)


def _prisms(corners: Ints) -> Ints:
    """Return the tetrahedra of prisms (n, 6), whose corner k + 3 is across from k; corners that are one take no room.

    After Dompierre et al. 1999: each side is cut from its corner with the least number.
    """
    swapped = corners[:, 3:].min(axis=1) < corners[:, :3].min(axis=1)
    corners = np.where(swapped[:, None], np.roll(corners, 3, axis=1), corners)
    turn = (np.argmin(corners[:, :3], axis=1)[:, None] + np.arange(3)) % 3
    v = np.take_along_axis(corners, np.concatenate([turn, turn + 3], axis=1), axis=1)
    up = np.minimum(v[:, 1], v[:, 5]) < np.minimum(v[:, 2], v[:, 4])
    ways = np.where(up[:, None, None], *_WAYS)
    tets = np.take_along_axis(v, ways.reshape(len(v), 12), axis=1).reshape(-1, 4)
    ranked = np.sort(tets, axis=1)
    return np.asarray(tets[(ranked[:, 1:] > ranked[:, :-1]).all(axis=1)])


def boundary(tets: Ints) -> Ints:
    """Return the triangles (f, 3) on the outside of tetrahedra (t, 4) of positive volume, wound outwards."""
    corners = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    faces = np.concatenate([tets[:, c] for c in corners])
    _, first, uses = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[np.sort(first[uses == 1])])


def pieces(tets: Ints, count: int) -> tuple[int, Ints]:
    """Return how many parts that do not hang together tetrahedra have, and that of each of the points (p)."""
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    edges = _edges(tets)
    graph: Any = sparse.csr_array((np.ones(len(edges)), edges.T), shape=(count, count))
    found, of = connected_components(graph, directed=False)
    return int(found), of.astype(np.int64)
