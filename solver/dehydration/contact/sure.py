"""Neighbours that need no look: what was far apart and has hardly bent since is still far apart.

Most pairs of triangles that a search meets share a node, and none of their features is in reach of another unless the
skin folds there. Two triangles come nearer by at most what a corner of one has moved as a corner of the other sees it;
where they share a node that is no more than both have bent, each counted by its own corners. So distances are measured
once in many searches, and hold until triangles have bent by what they have to spare.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Ints32
from .data import INLINE, OPTIONS, Contact, Single
from .distance import edge_edge, gone, node_triangle

__all__ = ["share_a_node", "trust"]

ROUNDING = np.float32(0.98)
"""Share of a spare distance that is believed: the rest is for rounding."""
MORE = 16
"""Distances are measured anew when one in so many triangles has come into doubt since they were."""


@njit(**OPTIONS)
def _judge(contact: Contact, reach: Single) -> int:
    """Fill `sure` at positions `searched`, and return how many triangles are not."""
    x, looked, triangles, around = contact.searched, contact.looked, contact.triangles, contact.around
    bent, least, sure, bending = contact.bent, contact.least, contact.sure, contact.bending
    for i in range(bending.size):
        t = bending[i]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        most = max(gone(x, looked, a, b), gone(x, looked, b, c), gone(x, looked, c, a))
        bent[t, 0] = np.sqrt(most)
        bent[t, 1] = np.float32(0)
    for i in range(around.shape[0]):
        t, u = around[i, 0], around[i, 1]
        bent[t, 1], bent[u, 1] = max(bent[t, 1], bent[u, 0]), max(bent[u, 1], bent[t, 0])
    doubts = 0
    for i in range(bending.size):
        t = bending[i]
        sure[t] = (least[t] - bent[t, 0] - bent[t, 1]) * ROUNDING > reach
        doubts += not sure[t]
    return doubts


@njit(**OPTIONS)
def _measure(contact: Contact) -> None:
    """Measure the distances at positions `searched`."""
    x, looked, around, least = contact.searched, contact.looked, contact.around, contact.least
    looked[:] = x
    least[:] = np.float32(np.inf)
    out = np.empty(8, np.float32)
    for i in range(around.shape[0]):
        a, b, c, d = around[i, 2], around[i, 3], around[i, 4], around[i, 5]
        if around[i, 6] == 0:
            node_triangle(x, a, b, c, d, out)
        else:
            edge_edge(x, a, b, c, d, out)
        for k in range(2):
            t = around[i, k]
            least[t] = min(least[t], out[7])


@njit(**OPTIONS)
def trust(contact: Contact, reach: Single) -> None:
    """Fill `sure` at positions `searched`: triangles none of whose features is within reach of one around them."""
    doubts = contact.doubts
    doubts[0] = _judge(contact, reach)
    if doubts[0] > doubts[1] + contact.triangles.shape[0] // MORE or not contact.looked[0, 0] < np.float32(1e14):
        _measure(contact)
        doubts[0] = doubts[1] = _judge(contact, reach)


@njit(**INLINE)
def share_a_node(triangles: Ints32, t: int, u: int) -> bool:
    """Whether triangles t and u share a node; no branches, nobody knows where they would go."""
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    d, e, f = triangles[u, 0], triangles[u, 1], triangles[u, 2]
    first, second, third = (
        (a == d) | (a == e) | (a == f),
        (b == d) | (b == e) | (b == f),
        (c == d) | (c == e) | (c == f),
    )
    return bool(first | second | third)
