"""What touches: the quads within reach of each node, and how much each of them counts.

It is continuous as the skin moves, or a settled stage would chatter: a node counts all quads nearly as close as the
closest, and walls on its other side (see `_weight`); next to its own quads the clearance begins at the shared edge; at
the mouth of a sulcus, where skin does not face skin yet, shallow contact counts all the same. Each of the three alone
left out-of-balance forces of 1e-2 to 1e-1 of the internal ones at s = 0.3 (preview, te = 0.04), together 1e-3.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact.closest import closest
from solver.dehydration.contact.data import ASKEW, OPTIONS, PAIRS, Contact, Single, Singles

__all__ = ["SLACK", "collect"]

NEARLY = np.float32(0.25)
"""Of the clearance: how much farther than the closest quad another one still counts."""
OPENING = np.float32(0.3)
"""Least slope between a quad and the next that contact keeps open, where they share an edge."""
SLACK = np.float32(0.25)
"""Of the margin: how far beyond the clearance a quad begins to share the load."""
SQUARELY = np.float32(0.7)
"""Least cosine between a penetrated quad's normal and the line to its closest point."""


@njit(**OPTIONS)
def _touches(gap: Single, height: Single, clearance: Single, depth: Single, on_skin: Single) -> bool:
    """Whether a node's nearest quad is touched: closer than the clearance, or penetrated but not through a part.

    Behind a quad only where it is seen squarely: a node past a ridge is nearest to its edge, and behind the plane of
    the far flank without being inside.
    """
    if gap >= clearance or gap < -depth:
        return False
    return bool(gap >= -on_skin or height > -SQUARELY * gap)


@njit(**OPTIONS)
def _near_quads(contact: Contact, x: Singles, v: Singles, first: int) -> tuple[int, int]:
    """Closest points of all quads paired with the node of pair `first`, into `near`.

    Returns how many are in reach, and the first pair of the next node.
    """
    near, one, quarter = contact.near, np.float32(1), np.float32(0.25)
    on_skin = np.float32(1e-3) * contact.size
    exact = np.float32(1e-7) * contact.size * contact.size
    reach = max(contact.clearance + SLACK * contact.margin, contact.depth) ** 2
    node, found, pair = contact.pair_nodes[first], 0, first
    row = contact.surface_nodes[node]
    while pair < contact.counts[PAIRS] and contact.pair_nodes[pair] == node:
        quad = contact.pair_quads[pair]
        a, b, c, d = (
            contact.quad_nodes[quad, 0], contact.quad_nodes[quad, 1],
            contact.quad_nodes[quad, 2], contact.quad_nodes[quad, 3],
        )  # fmt: skip
        s, t, ex, ey, ez, square, nx, ny, nz = closest(
            x, v, row, a, b, c, d, contact.feet[pair, 0], contact.feet[pair, 1], exact
        )
        contact.feet[pair, 0], contact.feet[pair, 1] = s, t
        own = contact.pair_own[pair]
        pair += 1
        if not square < reach or found == near.shape[0]:
            continue
        distance = np.sqrt(square)
        inverse = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-30))
        nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
        height = -(ex * nx + ey * ny + ez * nz)
        gap = distance if height >= 0 else -distance
        # along the line from foot to node no torque is left over; on the skin itself that line has no direction
        if distance > on_skin:
            nx, ny, nz = -ex / gap, -ey / gap, -ez / gap
        near[found, 0], near[found, 1] = quarter * (one - s) * (one - t), quarter * (one + s) * (one - t)
        near[found, 2], near[found, 3] = quarter * (one + s) * (one + t), quarter * (one - s) * (one + t)
        near[found, 4], near[found, 5], near[found, 6], near[found, 7] = nx, ny, nz, gap
        # next to its own quads a node is near for no fault of its own: let the clearance begin at the shared edge
        far = np.float32(0)
        for k in range(4):
            if not own >> k & 1:
                far += near[found, k]
        near[found, 10] = min(contact.clearance, OPENING * far * contact.size)
        near[found, 11] = abs(height)
        near[found, 12] = contact.shallow if own & ASKEW else contact.depth
        near[found, 13] = np.float32(quad)
        found += 1
    return found, pair


@njit(**OPTIONS)
def _nearest(contact: Contact, found: int) -> int:
    """Place in `near` of the closest quad."""
    near, same, best = contact.near, np.float32(1e-4) * contact.size, 0
    for i in range(1, found):
        nearer = abs(near[i, 7]) - abs(near[best, 7])
        # quads that share the closest edge are equally far: the one seen most squarely knows the side
        if abs(nearer) < same and (near[i, 7] >= 0) != (near[best, 7] >= 0):
            if near[i, 11] > near[best, 11]:
                best = i
        elif nearer < 0:
            best = i
    return best


@njit(**OPTIONS)
def _weight(contact: Contact, i: int, best: int) -> Single:
    """How much quad i of `near` counts beside the closest one, 0 to 1, continuous as the node moves.

    Quads nearly as close count nearly as much: with the closest alone a node in a valley, or between two walls, is
    thrown from one to the other. A wall on the other side of the node counts fully.
    """
    near, zero, one = contact.near, np.float32(0), np.float32(1)
    along = near[i, 4] * near[best, 4] + near[i, 5] * near[best, 5] + near[i, 6] * near[best, 6]
    if near[i, 7] < 0:
        return zero
    close = one - (near[i, 7] - abs(near[best, 7])) / (NEARLY * contact.clearance)
    return min(max(close, np.float32(-2) * along, zero), one)


@njit(**OPTIONS)
def collect(contact: Contact, x: Singles, v: Singles) -> int:
    """Quads within reach of each node, seen as the step began, into `hits`; returns how many."""
    clearance = contact.clearance + SLACK * contact.margin
    on_skin = np.float32(1e-3) * contact.size
    near, pair, hits = contact.near, 0, 0
    while pair < contact.counts[PAIRS]:
        node = contact.pair_nodes[pair]
        found, pair = _near_quads(contact, x, v, pair)
        if not found:
            continue
        best = _nearest(contact, found)
        if not _touches(near[best, 7], near[best, 11], clearance, near[best, 12], on_skin):
            continue
        for i in range(found):
            weight = np.float32(1) if i == best else _weight(contact, i, best)
            if weight > 0 and near[i, 7] < clearance and hits < contact.hits.shape[0]:
                contact.hits[hits, 0], contact.hits[hits, 1] = node, np.int32(near[i, 13])
                contact.hit_values[hits, :11] = near[i, :11]
                contact.hit_values[hits, 11] = weight
                hits += 1
    return hits
