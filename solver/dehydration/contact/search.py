"""Which nodes of the outer skin may touch which of its quads: a cell search over the moving surface.

Candidates are node-to-quad. The outer face of a hex8 element *is* a bilinear quad, so no diagonal has to be chosen and
the shape functions of the face carry the contact force to its corners. Quads that contain the node are its
neighbourhood; the next ones already count, because a deep sulcus closes on a crease that is one quad wide on each side.

The candidates stay complete while no node has moved farther than `margin` / 2 since the search (Verlet's list, 1967).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact.data import (
    ASKEW,
    NEEDED,
    OPPOSED,
    OPTIONS,
    PAIRS,
    SEARCHES,
    Contact,
    Integers,
    Long,
    Longs,
    Single,
    Singles,
)

GENTLE = np.float32(0.7071)
"""Cosine to the ellipsoid's normal above which nothing faces anything: two such normals are within 90 degrees."""
CREASED = np.float32(0.35)
"""Length of the mean of the unit normals around a node below which the node lies in a closed crease (its walls are
within 41 degrees of each other). Its own normal says nothing there, and its walls shield it: it touches nothing."""
WORLD = np.float32(2**20)
"""Cells counted from the origin in each direction; what lies farther out (or is not finite) touches nothing."""


@njit(**OPTIONS)
def _moved(contact: Contact, x: Singles) -> Single:
    """Largest squared distance of a surface node from where the last search saw it."""
    farthest = np.float32(0)
    for i in range(contact.surface_nodes.size):
        row = contact.surface_nodes[i]
        a = x[row, 0] - contact.searched[i, 0]
        b = x[row, 1] - contact.searched[i, 1]
        c = x[row, 2] - contact.searched[i, 2]
        farthest = max(farthest, a * a + b * b + c * c)
    return farthest


@njit(**OPTIONS)
def update_normals(contact: Contact, x: Singles) -> Single:
    """Quad centres, radii and normals, and nodal normals, at positions x.

    Returns the smallest cosine between a quad's normal and the normal of the rest ellipsoid through its centre. Points
    that touch share that ellipsoid normal, so where every cosine is above GENTLE no two of them can face each other:
    an unfolded skin is recognised without a search.
    """
    normals, frames, corners = contact.normals, contact.frames, contact.quad_nodes
    normals[:] = np.float32(0)
    contact.load[:] = np.float32(0)
    gentlest = np.float32(1)
    centre, scale = contact.ellipsoid[0], contact.ellipsoid[1]
    for q in range(corners.shape[0]):
        a, b, c, d = corners[q, 0], corners[q, 1], corners[q, 2], corners[q, 3]
        nx = (x[c, 1] - x[a, 1]) * (x[d, 2] - x[b, 2]) - (x[c, 2] - x[a, 2]) * (x[d, 1] - x[b, 1])
        ny = (x[c, 2] - x[a, 2]) * (x[d, 0] - x[b, 0]) - (x[c, 0] - x[a, 0]) * (x[d, 2] - x[b, 2])
        nz = (x[c, 0] - x[a, 0]) * (x[d, 1] - x[b, 1]) - (x[c, 1] - x[a, 1]) * (x[d, 0] - x[b, 0])
        inverse = np.float32(1) / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-30))
        frames[q, 4], frames[q, 5], frames[q, 6] = nx * inverse, ny * inverse, nz * inverse
        for i in range(3):
            frames[q, i] = np.float32(0.25) * (x[a, i] + x[b, i] + x[c, i] + x[d, i])
        radius = np.float32(0)
        for k in range(4):
            square = np.float32(0)
            for i in range(3):
                square += (x[corners[q, k], i] - frames[q, i]) ** 2
                # unit normals: weighted by area, the larger wall of a sharp crease would turn the normal into the
                # smaller one
                normals[contact.quads[q, k], i] += frames[q, 4 + i]
            contact.load[contact.quads[q, k]] += np.float32(1)
            radius = max(radius, square)
        frames[q, 3] = np.sqrt(radius)
        dot = square = level = np.float32(0)
        for i in range(3):
            offset = frames[q, i] - centre[i]
            direction = offset * scale[i]
            dot += direction * frames[q, 4 + i]
            square += direction * direction
            level += offset * direction
        # near the centre the ellipsoid's normal turns within an element: no statement possible there
        gentlest = min(gentlest, dot / np.sqrt(square + np.float32(1e-30))) if level > 0.04 else np.float32(-1)
    for i in range(normals.shape[0]):
        square = normals[i, 0] ** 2 + normals[i, 1] ** 2 + normals[i, 2] ** 2
        inverse = np.float32(1) / np.sqrt(square + np.float32(1e-30))
        if square < (CREASED * contact.load[i]) ** 2:
            inverse = np.float32(0)
        for k in range(3):
            normals[i, k] *= inverse
    return gentlest


@njit(**OPTIONS)
def cell_key(i: int, j: int, k: int) -> int:
    """One integer per cell, 21 bits a direction."""
    return ((i & 0x1FFFFF) << 42) | ((j & 0x1FFFFF) << 21) | (k & 0x1FFFFF)


@njit(**OPTIONS)
def bucket_of(key: int, buckets: int) -> Long:
    """Multiplicative hash of a cell; buckets is a power of two."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(buckets - 1))


@njit(**OPTIONS)
def _first_and_last(x: Singles, corners: Integers, q: int, i: int, reach: Single, cell: Single) -> tuple[Long, Long]:
    """First and last cell in direction i that quad q's bounding box, grown by reach, overlaps; (0, -1) if far away."""
    low = high = x[corners[q, 0], i]
    for k in range(1, 4):
        low = min(low, x[corners[q, k], i])
        high = max(high, x[corners[q, k], i])
    if not (low - reach > -WORLD * cell and high + reach < WORLD * cell):
        return np.int64(0), np.int64(-1)
    return np.int64(np.floor((low - reach) / cell)), np.int64(np.floor((high + reach) / cell))


@njit(**OPTIONS)
def sort_into_cells(
    x: Singles, quad_nodes: Integers, reach: Single, cell: Single, keys: Longs, order: Integers, starts: Integers
) -> Single:
    """Enter each quad, grown by reach, into every cell it overlaps; equal input gives equal order.

    A counting sort by hashed cell fills `order` (entries,) with quads and `keys` with their cells; `starts` holds the
    first entry of each bucket. A point then meets all quads within reach in its own cell. Cells widen until the
    entries fit, so that a few stretched quads cost memory nowhere. Returns the width of the cells.
    """
    buckets = starts.size - 1
    while True:
        entries = 0
        for q in range(quad_nodes.shape[0]):
            block = 1
            for i in range(3):
                first, last = _first_and_last(x, quad_nodes, q, i, reach, cell)
                block *= last - first + 1
            entries += block
        if entries <= order.size:
            break
        cell *= np.float32(1.5)
    starts[:] = 0
    for filling in range(2):
        for q in range(quad_nodes.shape[0]):
            i0, i1 = _first_and_last(x, quad_nodes, q, 0, reach, cell)
            j0, j1 = _first_and_last(x, quad_nodes, q, 1, reach, cell)
            k0, k1 = _first_and_last(x, quad_nodes, q, 2, reach, cell)
            for i in range(i0, i1 + 1):
                for j in range(j0, j1 + 1):
                    for k in range(k0, k1 + 1):
                        key = cell_key(i, j, k)
                        bucket = bucket_of(key, buckets)
                        if filling:
                            order[starts[bucket + 1]] = q
                            keys[starts[bucket + 1]] = key
                        starts[bucket + 1] += 1
        if filling:
            break
        for bucket in range(buckets):
            starts[bucket + 1] += starts[bucket]
        # starts[b + 1] serves as bucket b's cursor: it begins at its first entry and ends at the next bucket's
        for bucket in range(buckets, 0, -1):
            starts[bucket] = starts[bucket - 1]
        starts[0] = 0
    return cell


@njit(**OPTIONS)
def _near(
    x: Singles, row: int, quad_nodes: Integers, frames: Singles, quad: int, outward: Single, depth: Single
) -> tuple[bool, Single, Single]:
    """Whether the node is within reach of the quad by its mean plane, and a first guess of u and v."""
    a, b, c, d = quad_nodes[quad, 0], quad_nodes[quad, 1], quad_nodes[quad, 2], quad_nodes[quad, 3]
    quarter, one = np.float32(0.25), np.float32(1)
    gap = uu = uv = vv = pu = pv = np.float32(0)
    for i in range(3):
        offset = x[row, i] - frames[quad, i]
        along_u = quarter * (x[b, i] + x[c, i] - x[a, i] - x[d, i])
        along_v = quarter * (x[c, i] + x[d, i] - x[a, i] - x[b, i])
        gap += offset * frames[quad, 4 + i]
        uu += along_u * along_u
        uv += along_u * along_v
        vv += along_v * along_v
        pu += offset * along_u
        pv += offset * along_v
    # a warped quad leaves its mean plane by up to about a quarter of its radius
    warp = quarter * frames[quad, 3]
    inverse = one / (uu * vv - uv * uv + np.float32(1e-30))
    u = (pu * vv - pv * uv) * inverse
    v = (pv * uu - pu * uv) * inverse
    near = gap < outward + warp and gap > -depth - warp
    near &= (abs(u) - one) * np.sqrt(uu) < outward + warp and (abs(v) - one) * np.sqrt(vv) < outward + warp
    return near, min(max(u, -one), one), min(max(v, -one), one)


@njit(**OPTIONS)
def _own_corners(contact: Contact, node: int, quad: int) -> int:
    """Bits of the quad's corners that share another quad with the node."""
    bits = 0
    for k in range(4):
        for other in contact.rings[node]:
            if other == contact.quads[quad, k]:
                bits |= 1 << k
    return bits


@njit(**OPTIONS)
def find_pairs(contact: Contact, x: Singles) -> int:
    """Collect candidate pairs at positions x (nn, 4) float32; call every 20-40 steps.

    Returns the number of pairs wanted. More than `contact.pair_nodes.size` means that the rest was left out: `grow`
    and search again. Returns at once while no surface node has moved a quarter of the margin since the last search, so
    that list and normals stay valid for as long again. Pairs ascend by node, then by a fixed order of cells.
    """
    counts = contact.counts
    reach = contact.margin * np.float32(0.25)
    if _moved(contact, x) < reach * reach and counts[NEEDED] <= contact.pair_nodes.size:
        return int(counts[NEEDED])
    for i in range(contact.surface_nodes.size):
        for k in range(3):
            contact.searched[i, k] = x[contact.surface_nodes[i], k]
    gentlest = update_normals(contact, x)
    counts[PAIRS] = counts[NEEDED] = 0
    if gentlest > GENTLE:
        return int(counts[NEEDED])
    counts[SEARCHES] += 1
    outward = contact.clearance + contact.margin
    reach = max(outward, contact.depth)
    cell = contact.size + np.float32(2) * reach
    cell = sort_into_cells(x, contact.quad_nodes, reach, cell, contact.keys, contact.order, contact.starts)
    normals, frames, quads = contact.normals, contact.frames, contact.quads
    keys, order, starts = contact.keys, contact.order, contact.starts
    capacity = contact.pair_nodes.size
    for node in range(contact.surface_nodes.size):
        row = contact.surface_nodes[node]
        px, py, pz = x[row, 0], x[row, 1], x[row, 2]
        if not max(abs(px), abs(py), abs(pz)) < WORLD * cell:
            continue
        nx, ny, nz = normals[node, 0], normals[node, 1], normals[node, 2]
        if nx == 0 and ny == 0 and nz == 0:
            continue
        key = cell_key(np.int64(np.floor(px / cell)), np.int64(np.floor(py / cell)), np.int64(np.floor(pz / cell)))
        bucket = bucket_of(key, starts.size - 1)
        for place in range(starts[bucket], starts[bucket + 1]):
            quad = order[place]
            opposed = nx * frames[quad, 4] + ny * frames[quad, 5] + nz * frames[quad, 6] < OPPOSED
            away = (px - frames[quad, 0]) ** 2 + (py - frames[quad, 1]) ** 2 + (pz - frames[quad, 2]) ** 2
            if away > (frames[quad, 3] + reach) ** 2 or keys[place] != key:
                continue
            if node in (quads[quad, 0], quads[quad, 1], quads[quad, 2], quads[quad, 3]):
                continue
            depth = contact.depth if opposed else contact.shallow
            near, u, v = _near(x, row, contact.quad_nodes, frames, quad, outward, depth)
            if not near:
                continue
            pair = counts[NEEDED]
            if pair < capacity:
                contact.pair_nodes[pair], contact.pair_quads[pair] = node, quad
                contact.pair_own[pair] = _own_corners(contact, node, quad) | (0 if opposed else ASKEW)
                contact.feet[pair, 0], contact.feet[pair, 1] = u, v
            counts[NEEDED] += 1
    counts[PAIRS] = min(counts[NEEDED], contact.pair_nodes.size)
    return int(counts[NEEDED])
