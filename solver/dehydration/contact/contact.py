"""Self-contact of the skin for an explicit march with unit steps: springs that keep skin from crossing skin.

The march moves v and then x by v; `push_apart` adds the same increment to both:

    dx_j = dv_j = minv_j sum_c f_c b_cj n_c,   f_c = k_c phi(lacking_c) - damping,   lacking_c = clearance - g_c,

over all pairs c of a node and a triangle or of two edges, b being the shares of the pair's four nodes in the vector
from one closest point to the other: 1 at the node and minus the triangle's coordinates, or those of both edges.
Closest points and directions n are those at the beginning of the step, the gap g is the one they give for its end:
along the normal the penalty acts as backward Euler. The turning of the normals stays explicit.

A gap has the side on which its pair was first seen: what goes through within a step is sent back, not through.

phi is 0 without lack, quadratic up to half the clearance and linear beyond, so a contact that begins does not jolt; for
what had crossed when it was found it ends at a limit that leads out rather than throws. A contact takes its closing
speed out.

The eigenvalues of M^-1 B k B^T stay within [0, STIFFNESS], clear of what the masses leave to the step: with

    k_c = STIFFNESS w_c / sum_j |b_cj| minv_j S_j,   S_j = sum_d r_d |b_dj|,

over all pairs within reach, touched or not, the rows of k (B^T M^-1 B) weighted by r sum to at most STIFFNESS
(Gershgorin). r = w (1 at the clearance to 0 farthest off), so that none appears with a jump; w is 1 but for edges (see
`distance`). A lone contact is resolved in about one step, crowded nodes share. No tuning by mass or mesh is left.

Forces act along the line between the closest points, so linear and angular momentum balance to round-off; there is no
friction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Ints32, Singles
from .data import ACTIVE, BINS, HITS, LIVE, OPTIONS, PAIRS, READS, Contact, Single
from .distance import edge_edge, node_triangle

__all__ = ["measure", "prepare", "push_apart", "resolve"]

STIFFNESS = np.float32(1.0)
"""Of the 4 that a unit step carries, the masses leave 2 to contact."""
DAMPING = np.float32(1.0)
"""Share of a contact's closing speed that each step takes out; 0.3 let walls pulled together cross by 0.15 edges."""
SLACK = np.float32(0.08)
"""Of the margin: how far beyond the clearance a pair begins to share the load. With 0.25 the many pairs that are near
but do not touch made those that do so soft that walls pulled together crossed by a quarter of an edge."""
LOST = 2
"""Sides of pairs that have crossed: they stay what the search said."""


@njit(**OPTIONS)
def prepare(contact: Contact, x: Singles, v: Singles) -> int:
    """Positions at the beginning of the step, before x moved by v, and the number of pairs near enough to `measure`."""
    before, rows, counts = contact.before, contact.surface_nodes, contact.counts
    counts[LIVE] = counts[ACTIVE] = counts[HITS] = 0
    if counts[PAIRS] == 0:
        return 0
    farthest = np.float32(0)
    for place in range(counts[READS]):
        i = contact.reads[place]
        square = np.float32(0)
        for k in range(3):
            before[i, k] = x[rows[i], k] - v[rows[i], k]
            square += (before[i, k] - contact.searched[i, k]) ** 2
        farthest = max(farthest, square)
    # two nodes of a pair may both have come this far
    near = contact.clearance + SLACK * contact.margin + np.float32(2) * np.sqrt(farthest)
    last = np.int64(near * np.float32(BINS) / (contact.clearance + contact.margin)) + 1
    counts[LIVE] = contact.bins[last if last < BINS else BINS]
    return counts[LIVE]


@njit(**OPTIONS)
def measure(
    before: Singles, pairs: Ints32, values: Singles, weights: Singles, limits: Singles, depth: Single, slack: Single,
    i: int,
) -> None:  # fmt: skip
    """Closest points, gap and weight of pair i as the step began; each pair writes to its own place alone.

    The arrays are those of `Contact` by the same names, slack is SLACK of its margin: a parallel loop takes no tuples.
    """
    out, side = values[i], pairs[i, 5]
    known, sign = abs(side) == LOST, min(max(side, -1), 1)
    if pairs[i, 4] == 0:
        away, now = node_triangle(before, pairs[i, 0], pairs[i, 1], pairs[i, 2], pairs[i, 3], sign, out, False)
        # what is lost is not led out around a border: the next triangle sees its foot inside
        weight = np.float32(0) if known and now == 0 else np.float32(1)
    else:
        away, now, weight = edge_edge(before, pairs[i, 0], pairs[i, 1], pairs[i, 2], pairs[i, 3], sign, out)
    if not known:
        pairs[i, 5] = now
    if weight > 0 and (out[7] < -depth or (out[7] > 0 and away > limits[i] + slack)):
        weight = np.float32(0)
    weights[i] = weight


@njit(**OPTIONS)
def _share_load(contact: Contact, minv: Singles) -> None:
    """Stiffness of each hit into `hit_values`, from how much contact each node takes part in."""
    load, pairs, values, hits = contact.load, contact.pairs, contact.values, contact.hits
    rows, source = contact.surface_nodes, contact.source
    one, slack, count = np.float32(1), SLACK * contact.margin, contact.counts[HITS]
    load[:] = np.float32(0)
    for h in range(count):
        i = hits[h]
        share = contact.weights[i] * min(one, (contact.limits[i] + slack - values[i, 7]) / slack)
        for k in range(4):
            load[pairs[i, k]] += share * abs(values[i, k])
    for h in range(count):
        i = hits[h]
        crowd = np.float32(0)
        for k in range(4):
            node, b = pairs[i, k], abs(values[i, k])
            # an image takes part in what its source does, whether or not those pairs are looked at
            crowd += b * minv[rows[node]] * max(load[source[node]], b)
        contact.hit_values[h, 0] = STIFFNESS * contact.weights[i] / crowd if crowd > 0 else np.float32(0)


@njit(**OPTIONS)
def resolve(contact: Contact, x: Singles, v: Singles, minv: Singles) -> tuple[Single, float]:
    """Push what `measure` found too near; see `push_apart`."""
    counts, pairs, values, hits, forces = (
        contact.counts, contact.pairs, contact.values, contact.hits, contact.hit_values,
    )  # fmt: skip
    energy, deepest = np.float64(0), np.float32(0)
    rows, zero, half = contact.surface_nodes, np.float32(0), np.float32(0.5)
    found = 0
    for i in range(counts[LIVE]):
        if contact.weights[i] > 0:
            hits[found] = i
            found += 1
    counts[HITS] = found
    if found == 0:
        return deepest, energy
    _share_load(contact, minv)
    for h in range(found):
        i = hits[h]
        gap = speed = zero
        for k in range(4):
            row, b = rows[pairs[i, k]], values[i, k]
            for m in range(3):
                gap += b * values[i, 4 + m] * x[row, m]
                speed += b * values[i, 4 + m] * v[row, m]
        deepest = max(deepest, -gap)
        lacking, soft = contact.limits[i] - gap, half * contact.clearance
        forces[h, 1] = zero
        if lacking <= 0:
            continue
        begun = min(np.float32(1), lacking / soft)
        pushed = half * soft * begun * begun + max(lacking - soft, zero)
        if abs(pairs[i, 5]) == LOST:
            pushed = min(pushed, contact.recovery)
        forces[h, 1] = forces[h, 0] * max(pushed - DAMPING * begun * speed, zero)
        energy += forces[h, 0] * pushed * lacking * half
        counts[ACTIVE] += 1
    for h in range(found):
        if forces[h, 1] == 0:
            continue
        i = hits[h]
        for k in range(4):
            row = rows[pairs[i, k]]
            push = minv[row] * values[i, k] * forces[h, 1]
            for m in range(3):
                x[row, m] += push * values[i, 4 + m]
                v[row, m] += push * values[i, 4 + m]
    return deepest, energy


@njit(**OPTIONS)
def push_apart(contact: Contact, x: Singles, v: Singles, minv: Singles) -> tuple[Single, float]:
    """Push touching skin apart; call in every step right after x has moved by v, and `find_pairs` every so often.

    x, v (nn, 4) float32 are changed in place; minv (nn,) float32 inverse scaled masses (0: fixed). All gaps are taken
    before any push, so the order of the pairs does not matter. Returns the deepest penetration (0 if none; a gap below
    the clearance but positive is none) and the contact energy in units of the scaled masses.
    """
    live, slack = prepare(contact, x, v), SLACK * contact.margin
    for i in range(live):
        measure(contact.before, contact.pairs, contact.values, contact.weights, contact.limits, contact.depth, slack, i)
    return resolve(contact, x, v, minv)
