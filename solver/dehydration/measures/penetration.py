"""How deep the skin is inside itself: a measure in float64 that shares no geometry with the contact of the march.

Quads are split into four flat triangles about their centre. A node counts as inside another part of the skin when the
nearest point of all triangles that do not contain the node lies on one that faces the node's own skin, the node is
behind that triangle, and, on a closed skin, the winding number just outside the node's own skin confirms that this
place is inside the fruit (Jacobson, Kavan & Sorkine 2013, doi 10.1145/2461912.2461916). The winding number tells a
thin neck, whose far side is near and turned away, from a fold that has gone through itself.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ...arrays import Floats, Ints

__all__ = ["penetration", "penetration_depths"]

CREASED = 0.35
"""Length of the mean unit normal around a node below which the node lies in a closed crease: see `_normals`."""
OPPOSED = -0.25
"""Cosine between outward normals below which skin faces skin."""
LIFT = 0.01
"""How far above its own skin a node's place is tested for being inside, in mean edges."""


@njit(cache=True, error_model="numpy")
def _dot(a: Floats, b: Floats) -> float:
    found: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return found


@njit(cache=True, error_model="numpy")
def _cross(a: Floats, b: Floats) -> Floats:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(cache=True, error_model="numpy")
def closest_on_triangle(p: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """Point of the triangle abc nearest to p, each (3,). Ericson, Real-Time Collision Detection (2005), 5.1.5."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return a
    bp = p - b
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        return a + ab * (d1 / (d1 - d3))
    cp = p - c
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        return a + ac * (d2 / (d2 - d6))
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 >= d3 and d5 >= d6:
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    return a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))


@njit(cache=True, error_model="numpy")
def winding_number(p: Floats, corners: Floats, centres: Floats) -> float:
    """Signed number of times the skin encloses p (3,); corners (nq, 4, 3), centres (nq, 3).

    Solid angles by van Oosterom & Strackee 1983, doi 10.1109/TBME.1983.325207.
    """
    total = 0.0
    for q in range(centres.shape[0]):
        c = centres[q] - p
        lc = math.sqrt(_dot(c, c))
        for k in range(4):
            a, b = corners[q, k] - p, corners[q, (k + 1) % 4] - p
            la, lb = math.sqrt(_dot(a, a)), math.sqrt(_dot(b, b))
            volume = _dot(a, _cross(b, c))
            total += math.atan2(volume, la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb)
    return total / (2 * math.pi)


@njit(cache=True, error_model="numpy")
def _sort_nodes(positions: Floats, low: Floats, cell: float, counts: Ints, starts: Ints, order: Ints) -> None:
    """Nodes sorted into a plain grid of cells counts (3,): `order` (ns,) and the first of each cell in `starts`."""
    place = np.empty(positions.shape[0], np.int64)
    for i in range(positions.shape[0]):
        index = np.int64(0)
        for k in range(3):
            index = index * counts[k] + min(np.int64((positions[i, k] - low[k]) / cell), counts[k] - 1)
        place[i] = index
        starts[index + 1] += 1
    for cell_index in range(starts.size - 1):
        starts[cell_index + 1] += starts[cell_index]
    cursor = starts.copy()
    for i in range(positions.shape[0]):
        order[cursor[place[i]]] = i
        cursor[place[i]] += 1


@njit(cache=True, error_model="numpy")
def _depths(
    positions: Floats,
    quads: Ints,
    corners: Floats,
    centres: Floats,
    normals: Floats,
    low: Floats,
    cell: float,
    counts: Ints,
    limit: float,
    lift: float,
    closed: bool,
    depths: Floats,
) -> None:
    """Fill depths (ns,); see `penetration_depths`."""
    starts = np.zeros(counts[0] * counts[1] * counts[2] + 1, np.int64)
    order = np.empty(positions.shape[0], np.int64)
    _sort_nodes(positions, low, cell, counts, starts, order)
    nearest = np.full(positions.shape[0], limit)
    lean = np.zeros(positions.shape[0])
    behind = np.zeros(positions.shape[0], np.bool_)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for q in range(quads.shape[0]):
        for k in range(3):
            least, most = corners[q, :, k].min() - limit - low[k], corners[q, :, k].max() + limit - low[k]
            first[k] = np.int64(max(least, 0.0) / cell)
            last[k] = np.int64(min(most / cell, counts[k] - 1))
        for ix in range(first[0], last[0] + 1):
            for iy in range(first[1], last[1] + 1):
                row = (ix * counts[1] + iy) * counts[2]
                for place in range(starts[row + first[2]], starts[row + last[2] + 1]):
                    node = order[place]
                    if node == quads[q, 0] or node == quads[q, 1] or node == quads[q, 2] or node == quads[q, 3]:
                        continue
                    for k in range(4):
                        a, b = corners[q, k], corners[q, (k + 1) % 4]
                        offset = positions[node] - closest_on_triangle(positions[node], a, b, centres[q])
                        distance = math.sqrt(_dot(offset, offset))
                        if distance > nearest[node] + 1e-9 * limit:
                            continue
                        normal = _cross(b - a, centres[q] - a)
                        normal /= math.sqrt(_dot(normal, normal)) + 1e-300
                        # several triangles share an edge or corner: the one seen most squarely has the right sign
                        square = abs(_dot(offset, normal))
                        if distance < nearest[node] - 1e-9 * limit or square > lean[node]:
                            nearest[node], lean[node] = distance, square
                            inward = _dot(offset, normal) < 0
                            behind[node] = inward and _dot(normal, normals[node]) < OPPOSED
    for node in range(positions.shape[0]):
        if behind[node]:
            # an open sheet has no inside: there a node must at least be seen squarely, not from past a border
            inside = lean[node] > 0.7 * nearest[node]
            if closed:
                inside = abs(winding_number(positions[node] + lift * normals[node], corners, centres)) > 0.5
            depths[node] = nearest[node] if inside else 0.0


def _normals(corners: Floats, faces: Ints, nodes: int) -> Floats:
    """Outward nodal normals weighted by the quads' angles at the node (Baerentzen & Aanaes 2005), (nodes, 3).

    Weighted by area, the larger wall of a sharp crease would turn them into the smaller one. At the bottom of a closed
    crease the walls' normals cancel and the node's own says nothing: it is 0, which keeps the node out of the measure.
    Whether the walls cross is told by the nodes beside it.
    """
    normals, angles = np.zeros((nodes, 3)), np.zeros(nodes)
    for k in range(4):
        ahead, back = corners[:, (k + 1) % 4] - corners[:, k], corners[:, k - 1] - corners[:, k]
        area = np.cross(ahead, back)
        size = np.linalg.norm(area, axis=1)
        angle = np.arctan2(size, (ahead * back).sum(1))
        np.add.at(normals, faces[:, k], area * (angle / (size + 1e-300))[:, None])
        np.add.at(angles, faces[:, k], angle)
    length = np.linalg.norm(normals, axis=1)
    return normals * np.where(length > CREASED * angles, 1 / (length + 1e-300), 0.0)[:, None]


def penetration_depths(positions: ArrayLike, quads: ArrayLike, limit: float | None = None) -> Floats:
    """Depth of each surface node inside other parts of the skin, (ns,) in the units of positions; 0 where free.

    positions (ns, >= 3), quads (nq, 4) counter-clockwise from outside. Depths beyond limit (one mean edge length unless
    given) are not looked for.
    """
    x = np.ascontiguousarray(np.asarray(positions, np.float64)[:, :3])
    faces = np.ascontiguousarray(quads, np.int64)
    if not np.isfinite(x).all():
        raise ValueError("penetration needs finite positions")
    corners = np.ascontiguousarray(x[faces])
    normals = _normals(corners, faces, len(x))
    h = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())
    reach = h if limit is None else limit
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    closed = bool(np.array_equal(np.sort(tails * len(x) + heads), np.sort(heads * len(x) + tails)))
    low = x.min(0)
    extent = x.max(0) - low
    cell = max(1.5 * h, float(extent.max()) / 100)
    counts = (extent / cell).astype(np.int64) + 1
    depths = np.zeros(len(x))
    _depths(x, faces, corners, corners.mean(1), normals, low, cell, counts, reach, LIFT * h, closed, depths)
    return depths


def penetration(positions: ArrayLike, quads: ArrayLike, limit: float | None = None) -> float:
    """Deepest of `penetration_depths`."""
    return float(penetration_depths(positions, quads, limit).max(initial=0.0))
