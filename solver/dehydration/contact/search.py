"""Which nodes of the outer skin may touch which triangles, and which edges which: a search over the moving surface.

Each quad of the skin is two triangles, those that anybody sees who looks at it, so what contact keeps apart is what is
counted as crossing. Nodes and triangles, edges and edges: skin that passes through skin does one of the two first.
Nothing is left out as a neighbour but what shares a node: a sulcus closes on a crease one element wide on each side.

The candidates stay complete while no node has moved farther than a quarter of `margin` since the search (Verlet's list,
1967). They are sorted by distance: a step looks at the near ones alone.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from ...arrays import Bools, Ints, Ints32, Singles
from .cells import first_of, overlapping, sort_into_cells, spread
from .data import (
    AT_ONCE,
    BATCH,
    BINS,
    HITS,
    INLINE,
    LIVE,
    NEEDED,
    OPTIONS,
    PAIRS,
    PARTS,
    READS,
    SEARCHES,
    Contact,
    Single,
)
from .distance import edge_edge, node_triangle
from .sure import share_a_node, trust

GENTLE = np.float32(0.7071)
"""Cosine to the ellipsoid's normal above which nothing faces anything: two such normals are within 90 degrees."""
SURE = np.float32(0.98)
"""Share of a gap that is believed: the rest is for rounding."""
OPENING = np.float32(0.3)
"""Largest clearance of a pair, as a share of its distance in the fresh fruit."""


@njit(**OPTIONS)
def farthest_moved(contact: Contact, x: Singles) -> Single:
    """Largest distance of a node that is nobody's image from where the last search saw it; images move as they do."""
    farthest, rows, source, searched = np.float32(0), contact.surface_nodes, contact.source, contact.searched
    for i in range(rows.size):
        if source[i] != i:
            continue
        row = rows[i]
        a = x[row, 0] - searched[i, 0]
        b = x[row, 1] - searched[i, 1]
        c = x[row, 2] - searched[i, 2]
        farthest = max(farthest, a * a + b * b + c * c)
    found: Single = np.sqrt(farthest)
    return found


@njit(parallel=True, **OPTIONS)
def gentlest(x: Singles, corners: Ints32, ellipsoid: Singles) -> Single:
    """Smallest cosine between a triangle's normal and the normal of the rest ellipsoid through its centre.

    Points that touch share that ellipsoid normal, so where every cosine is above GENTLE no two of them can face each
    other: an unfolded skin is recognised without a search. x, corners, ellipsoid: `searched`, `triangles` and
    `ellipsoid` of the contact.
    """
    centre, scale = ellipsoid[0], ellipsoid[1]
    parts, third = np.empty(PARTS, np.float32), np.float32(1 / 3)
    for part in prange(PARTS):
        least = np.float32(1)
        for q in range(part * corners.shape[0] // PARTS, (part + 1) * corners.shape[0] // PARTS):
            a, b, c = corners[q, 0], corners[q, 1], corners[q, 2]
            nx = (x[b, 1] - x[a, 1]) * (x[c, 2] - x[a, 2]) - (x[b, 2] - x[a, 2]) * (x[c, 1] - x[a, 1])
            ny = (x[b, 2] - x[a, 2]) * (x[c, 0] - x[a, 0]) - (x[b, 0] - x[a, 0]) * (x[c, 2] - x[a, 2])
            nz = (x[b, 0] - x[a, 0]) * (x[c, 1] - x[a, 1]) - (x[b, 1] - x[a, 1]) * (x[c, 0] - x[a, 0])
            inverse = np.float32(1) / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-30))
            dx = third * (x[a, 0] + x[b, 0] + x[c, 0]) - centre[0]
            dy = third * (x[a, 1] + x[b, 1] + x[c, 1]) - centre[1]
            dz = third * (x[a, 2] + x[b, 2] + x[c, 2]) - centre[2]
            ex, ey, ez = dx * scale[0], dy * scale[1], dz * scale[2]
            square, level = ex * ex + ey * ey + ez * ez, dx * ex + dy * ey + dz * ez
            dot = (ex * nx + ey * ny + ez * nz) * inverse
            # near the centre the ellipsoid's normal turns within an element: no statement possible there
            least = min(least, dot / np.sqrt(square + np.float32(1e-30))) if level > 0.04 else np.float32(-1)
        parts[part] = least
    found: Single = parts.min()
    return found


@njit(parallel=True, **OPTIONS)
def _enclose(x: Singles, triangles: Ints32, source: Ints32, reach: Single, boxes: Singles) -> None:
    """Boxes of the triangles; one out of reach of all nodes that are nobody's image gets none."""
    low, high = np.full(3, np.float32(np.inf)), np.full(3, np.float32(-np.inf))
    for i in range(x.shape[0]):
        if source[i] == i:
            for k in range(3):
                low[k], high[k] = min(low[k], x[i, k] - reach), max(high[k], x[i, k] + reach)
    for t in prange(boxes.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        near = True
        for k in range(3):
            boxes[t, k] = min(x[a, k], x[b, k], x[c, k])
            boxes[t, 3 + k] = max(x[a, k], x[b, k], x[c, k])
            near &= boxes[t, k] <= high[k] and boxes[t, 3 + k] >= low[k]
        if not near:
            for k in range(3):
                boxes[t, k], boxes[t, 3 + k] = np.float32(np.inf), np.float32(-np.inf)


@njit(**INLINE)
def _enter(found: Ints32, place: int, a: int, b: int, c: int, d: int, kind: int) -> int:
    """Enter a pair at `place` if there is room: node a and triangle b c d, or edges a b and c d. Returns the next."""
    if place < found.shape[0]:
        found[place, 0], found[place, 1], found[place, 2], found[place, 3], found[place, 4] = a, b, c, d, kind
    return place + 1


@njit(parallel=True, **OPTIONS)
def _hold_apart(x: Singles, rest: Singles, clearance: Single, found: Ints32, away: Singles, count: int) -> None:
    """Distance and clearance of the first `count` pairs; what was near in the fresh fruit keeps less of it."""
    for part in prange((count + BATCH - 1) // BATCH):
        out = np.empty(8, np.float32)
        for i in range(part * BATCH, min((part + 1) * BATCH, count)):
            a, b, c, d = found[i, 0], found[i, 1], found[i, 2], found[i, 3]
            if found[i, 4] == 0:
                away[i, 0] = node_triangle(x, a, b, c, d, out)
                node_triangle(rest, a, b, c, d, out)
            else:
                edge_edge(x, a, b, c, d, out)
                away[i, 0] = out[7]
                edge_edge(rest, a, b, c, d, out)
            away[i, 1] = min(clearance, OPENING * out[7])


@njit(**INLINE)
def _clear_of(x: Singles, triangles: Ints32, t: int, u: int, reach: Single) -> bool:
    """Whether triangles t and u (corners in rows of x) are farther apart than the reach along the way between their
    middles, and so everywhere; most that are met are.
    """
    a, b, c, d, e, f = (
        triangles[t, 0],
        triangles[t, 1],
        triangles[t, 2],
        triangles[u, 0],
        triangles[u, 1],
        triangles[u, 2],
    )
    way0 = x[d, 0] + x[e, 0] + x[f, 0] - x[a, 0] - x[b, 0] - x[c, 0]
    way1 = x[d, 1] + x[e, 1] + x[f, 1] - x[a, 1] - x[b, 1] - x[c, 1]
    way2 = x[d, 2] + x[e, 2] + x[f, 2] - x[a, 2] - x[b, 2] - x[c, 2]
    last = max(
        x[a, 0] * way0 + x[a, 1] * way1 + x[a, 2] * way2,
        x[b, 0] * way0 + x[b, 1] * way1 + x[b, 2] * way2,
        x[c, 0] * way0 + x[c, 1] * way1 + x[c, 2] * way2,
    )
    first = min(
        x[d, 0] * way0 + x[d, 1] * way1 + x[d, 2] * way2,
        x[e, 0] * way0 + x[e, 1] * way1 + x[e, 2] * way2,
        x[f, 0] * way0 + x[f, 1] * way1 + x[f, 2] * way2,
    )
    spare = (first - last) * SURE
    return bool((spare > 0) & (spare * spare > reach * reach * (way0 * way0 + way1 * way1 + way2 * way2)))


@njit(**INLINE)
def _nodes_near(
    triangles: Ints32, own: Ints32, boxes: Singles, x: Singles, source: Ints32, mine: int, theirs: int, reach: Single,
    out: Singles,
) -> int:  # fmt: skip
    """Bits of the nodes that triangle `mine` answers for and that are within reach of `theirs`."""
    near, b, c, d = 0, triangles[theirs, 0], triangles[theirs, 1], triangles[theirs, 2]
    images = source[b] != b and source[c] != c and source[d] != d
    for i in range(3):
        a = own[mine, i]
        if a < 0:
            break
        if (a == b) | (a == c) | (a == d) or (images and source[a] != a):
            continue
        meets = True
        for k in range(3):
            meets &= x[a, k] <= boxes[theirs, 3 + k] + reach and x[a, k] >= boxes[theirs, k] - reach
        if meets and node_triangle(x, a, b, c, d, out) < reach:
            near |= 1 << i
    return near


@njit(**INLINE)
def _edges_near(
    own: Ints32, boxes: Singles, x: Singles, source: Ints32, t: int, u: int, reach: Single, out: Singles
) -> int:
    """Bits 3 i + j of the edges i and j that triangles t and u answer for and that are within reach of each other."""
    near = 0
    for i in range(3):
        a, b = own[t, i, 0], own[t, i, 1]
        if a < 0:
            break
        meets = True
        for k in range(3):
            meets &= min(x[a, k], x[b, k]) <= boxes[u, 3 + k] + reach
            meets &= boxes[u, k] <= max(x[a, k], x[b, k]) + reach
        if not meets:
            continue
        images = source[a] != a and source[b] != b
        for j in range(3):
            c, d = own[u, j, 0], own[u, j, 1]
            if c < 0:
                break
            if (a == c) | (a == d) | (b == c) | (b == d) or (images and source[c] != c and source[d] != d):
                continue
            meets = True
            for k in range(3):
                meets &= min(x[a, k], x[b, k]) <= max(x[c, k], x[d, k]) + reach
                meets &= min(x[c, k], x[d, k]) <= max(x[a, k], x[b, k]) + reach
            if meets:
                edge_edge(x, a, b, c, d, out)
                if out[7] < reach:
                    near |= 1 << (3 * i + j)
    return near


@njit(parallel=True, **OPTIONS)
def _look(
    met: Ints32, near: Ints32, count: int, triangles: Ints32, own_nodes: Ints32, own_edges: Ints32, boxes: Singles,
    x: Singles, source: Ints32, sure: Bools, reach: Single,
) -> None:  # fmt: skip
    """Bits of the features in reach of the first `count` pairs met: 3 + 3 of nodes, 9 of edges; side by side."""
    for part in prange((count + BATCH - 1) // BATCH):
        out = np.empty(8, np.float32)
        for m in range(part * BATCH, min((part + 1) * BATCH, count)):
            t, u = met[m, 0], met[m, 1]
            if (sure[t] | sure[u]) and share_a_node(triangles, t, u):
                near[m] = 0
                continue
            if _clear_of(x, triangles, t, u, reach):
                near[m] = 0
                continue
            found = _nodes_near(triangles, own_nodes, boxes, x, source, t, u, reach, out)
            found |= _nodes_near(triangles, own_nodes, boxes, x, source, u, t, reach, out) << 3
            near[m] = found | _edges_near(own_edges, boxes, x, source, t, u, reach, out) << 6


@njit(**OPTIONS)
def _take_in(contact: Contact, count: int, reach: Single) -> None:
    """Enter all pairs of features in reach that the first `count` pairs of triangles met answer for."""
    triangles, x, met, near = contact.triangles, contact.searched, contact.met, contact.near
    own_nodes, own_edges = contact.own_nodes, contact.own_edges
    found = contact.found
    _look(met, near, count, triangles, own_nodes, own_edges, contact.boxes, x, contact.source, contact.sure, reach)
    place = contact.counts[NEEDED]
    for first in range(0, count, BATCH):
        last = min(first + BATCH, count)
        for m in range(2 * first, 2 * last):
            bits = near[m // 2] >> (3 * (m % 2)) & 7
            if bits == 0:
                continue
            mine, theirs = met[m // 2, m % 2], met[m // 2, 1 - m % 2]
            b, c, d = triangles[theirs, 0], triangles[theirs, 1], triangles[theirs, 2]
            for i in range(3):
                if bits >> i & 1:
                    place = _enter(found, place, own_nodes[mine, i], b, c, d, 0)
        for m in range(first, last):
            bits = near[m] >> 6
            if bits == 0:
                continue
            t, u = met[m, 0], met[m, 1]
            for i in range(3):
                for j in range(3):
                    if bits >> (3 * i + j) & 1:
                        a, b, c, d = own_edges[t, i, 0], own_edges[t, i, 1], own_edges[u, j, 0], own_edges[u, j, 1]
                        place = _enter(found, place, a, b, c, d, 1)
    contact.counts[NEEDED] = place


@njit(parallel=True, **OPTIONS)
def _meet(order: Ints32, starts: Ints32, sides: Singles, marks: Ints32, met: Ints32, counts: Ints) -> None:
    """Pairs of triangles in reach, side by side: each part of the cells fills its own share of `met`, if it can.

    counts: (PARTS,) pairs of each part.
    """
    buckets, room = starts.size - 1, met.shape[0] // PARTS
    for part in prange(PARTS):
        count = 0
        for bucket in range(part * buckets // PARTS, (part + 1) * buckets // PARTS):
            last = starts[bucket + 1]
            for i in range(starts[bucket], last - 1):
                for j in range(i + 1, last, AT_ONCE):
                    bits = overlapping(sides, marks, i, j, last)
                    while bits:
                        if count < room:
                            place = part * room + count
                            met[place, 0], met[place, 1] = order[i], order[j + first_of(bits)]
                        bits &= bits - 1
                        count += 1
        counts[part] = count


@njit(**OPTIONS)
def _visit(contact: Contact, reach: Single, cell: Single) -> None:
    """Go through all pairs of triangles in reach and take in their features, in the order of the cells."""
    order, starts, met, counts = contact.order, contact.starts, contact.met, contact.met_by_part
    sides, marks, room = contact.sides, contact.marks, contact.met.shape[0]
    half, entries = np.float32(0.5) * reach, starts[starts.size - 1]
    spread(contact.boxes, reach, half, cell, contact.keys, order, entries, sides, marks)
    _meet(order, starts, sides, marks, met, counts)
    count = 0
    if counts.max() <= room // PARTS:
        for part in range(PARTS):
            for m in range(part * (room // PARTS), part * (room // PARTS) + counts[part]):
                met[count, 0], met[count, 1] = met[m, 0], met[m, 1]
                count += 1
    else:
        # more than a part has room for: round by round
        for bucket in range(starts.size - 1):
            last = starts[bucket + 1]
            for i in range(starts[bucket], last - 1):
                for j in range(i + 1, last, AT_ONCE):
                    bits = overlapping(sides, marks, i, j, last)
                    while bits:
                        met[count, 0], met[count, 1] = order[i], order[j + first_of(bits)]
                        bits &= bits - 1
                        count += 1
                        if count == room:
                            _take_in(contact, count, reach)
                            count = 0
    _take_in(contact, count, reach)


@njit(**OPTIONS)
def _sort_by_distance(contact: Contact, reach: Single) -> None:
    """Put the pairs found into classes of distance, and list the nodes that steps will look at."""
    bins, pairs, found = contact.bins, contact.counts[PAIRS], contact.found
    bins[:] = 0
    scale = np.float32(BINS) / reach
    for i in range(pairs):
        k = int(contact.away[i, 0] * scale)
        bins[k + 1 if k < BINS else BINS] += 1
    for k in range(BINS):
        bins[k + 1] += bins[k]
    for i in range(pairs):
        k = int(contact.away[i, 0] * scale)
        k = k if k < BINS else BINS - 1
        place = bins[k]
        bins[k] += 1
        contact.apart[place], contact.limits[place] = contact.away[i, 0], contact.away[i, 1]
        for m in range(5):
            contact.pairs[place, m] = found[i, m]
    for k in range(BINS, 0, -1):
        bins[k] = bins[k - 1]
    bins[0] = 0
    contact.load[:] = np.float32(0)
    for i in range(pairs):
        for m in range(4):
            contact.load[found[i, m]] = np.float32(1)
    contact.counts[READS] = 0
    for i in range(contact.source.size):
        if contact.source[i] == i or contact.load[i] > 0:
            contact.reads[contact.counts[READS]] = i
            contact.counts[READS] += 1


@njit(**OPTIONS)
def is_stale(contact: Contact) -> bool:
    """Whether the step just made has come so near to the end of the list's validity that the next may pass it."""
    return bool(contact.moved[0] > np.float32(0.35) * contact.margin)


@njit(**OPTIONS)
def find_pairs(contact: Contact, x: Singles) -> int:
    """Collect candidate pairs at positions x (nn, 4) float32; call every 10 steps, and when `is_stale`.

    Returns the number of pairs wanted. More than there is room for means that the rest was left out: `grow` and search
    again. Returns at once while no node has moved a quarter of the margin since the last search, so that the list stays
    valid for as long again. Pairs come in a fixed order of cells, then by distance.
    """
    counts = contact.counts
    reach = contact.margin * np.float32(0.25)
    if farthest_moved(contact, x) < reach and counts[NEEDED] <= contact.pairs.shape[0]:
        return int(counts[NEEDED])
    finite = True
    for i in range(contact.surface_nodes.size):
        for k in range(3):
            contact.searched[i, k] = x[contact.surface_nodes[i], k]
            finite &= abs(contact.searched[i, k]) < np.float32(1e6)
    counts[PAIRS] = counts[NEEDED] = counts[HITS] = counts[LIVE] = counts[READS] = 0
    contact.moved[0] = 0
    if not finite or gentlest(contact.searched, contact.triangles, contact.ellipsoid) > GENTLE:
        return int(counts[NEEDED])
    counts[SEARCHES] += 1
    reach = contact.clearance + contact.margin
    half = np.float32(0.5) * reach
    _enclose(contact.searched, contact.triangles, contact.source, reach, contact.boxes)
    trust(contact, reach)
    cell = contact.size + reach
    cell = sort_into_cells(contact.boxes, half, cell, contact.keys, contact.order, contact.starts, contact.entered)
    _visit(contact, reach, cell)
    counts[PAIRS] = min(counts[NEEDED], contact.pairs.shape[0])
    _hold_apart(contact.searched, contact.rest, contact.clearance, contact.found, contact.away, counts[PAIRS])
    _sort_by_distance(contact, reach)
    return int(counts[NEEDED])
