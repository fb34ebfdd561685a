"""Self-contact of the skin for an explicit march with unit steps: springs that keep skin off skin, and no step through.

The march moves v and then x by v; `push_apart` adds the same increment to both:

    dx_j = dv_j = minv_j sum_c f_c b_cj n_c,   f_c = k_c phi(lacking_c) - damping,   lacking_c = clearance - g_c,

over all pairs c of a node and a triangle or of two edges, b being the shares of the pair's four nodes in the vector
from one closest point to the other: 1 at the node and minus the triangle's coordinates, or those of both edges.
Closest points and directions n are those at the beginning of the step, the gap g is the one they give for its end:
along the normal the penalty acts as backward Euler. The turning of the normals stays explicit.

phi is 0 without lack, quadratic up to half the clearance and linear beyond, so a contact that begins does not jolt. A
contact takes its closing speed out.

Nothing goes through: no node ends a step farther from where it began than SAFE times the distance at which it began
from what it might touch. Both of a pair coming, they stay apart by the rest (Wu, Wu, Yang & Wang, ACM
Transactions on Graphics 40, 2020, bound steps of cloth so). A step of a march is a thousandth of an edge; where that
bound acts at all it takes momentum away, as a wall does.

The eigenvalues of M^-1 B k B^T stay within [0, STIFFNESS], clear of what the masses leave to the step: with

    k_c = STIFFNESS w_c / sum_j |b_cj| minv_j S_j,   S_j = sum_d r_d |b_dj|,

over all pairs within reach, touched or not, the rows of k (B^T M^-1 B) weighted by r sum to at most STIFFNESS
(Gershgorin). r = w (1 at the clearance to 0 farthest off), so that none appears with a jump; w is 1 but for edges (see
`distance`). A lone contact is resolved in about one step, crowded nodes share. No tuning by mass or mesh is left.

Forces act along the line between the closest points, so they keep linear and angular momentum to round-off; there is no
friction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Ints32, Singles
from .data import ACTIVE, BINS, HELD, HITS, INLINE, LIVE, OPTIONS, PAIRS, READS, Contact, Single
from .distance import edge_edge, gone, node_triangle

__all__ = ["depart", "measure", "near", "prepare", "push_apart", "resolve"]

STIFFNESS = np.float32(1.0)
"""Of the 4 that a unit step carries, the masses leave 2 to contact."""
DAMPING = np.float32(1.0)
"""Share of a contact's closing speed that each step takes out; 0.3 let walls pulled together come much nearer."""
SLACK = np.float32(0.08)
"""Of the margin: how far beyond the clearance a pair begins to share the load. With 0.25 the many pairs that are near
but do not touch made those that do so soft that walls pulled together came together by a quarter of an edge."""
SAFE = np.float32(0.45)
"""Share of a distance that each side of a pair may go in a step: both together do not meet, nor do they by rounding."""
UNHELD = np.float32(0.99)
"""Share of a square that is believed: the rest is for rounding."""
SURE = np.float32(0.98)
"""Share of what a pair may come nearer by without counting that is believed: the rest is for rounding."""


@njit(**INLINE)
def depart(
    before: Singles, searched: Singles, rows: Ints32, reads: Ints32, x: Singles, v: Singles, extremes: Singles,
    share: int, first: int, last: int,
) -> None:  # fmt: skip
    """Positions of a share of the nodes at the beginning of the step, before x moved by v, and the extremes among them.

    The arrays are those of `Contact` by the same names; the share is the entries `first` to `last` of `reads`.
    """
    farthest = fastest = np.float32(0)
    for place in range(first, last):
        i = reads[place]
        square = speed = np.float32(0)
        for k in range(3):
            before[i, k] = x[rows[i], k] - v[rows[i], k]
            square += (before[i, k] - searched[i, k]) ** 2
            speed += v[rows[i], k] ** 2
        farthest, fastest = max(farthest, square), max(fastest, speed)
    extremes[share, 0], extremes[share, 1] = farthest, fastest


@njit(**OPTIONS)
def near(contact: Contact, shares: int) -> int:
    """Number of pairs near enough to `measure`, once that many shares of the nodes have departed."""
    counts, extremes = contact.counts, contact.extremes
    counts[LIVE] = counts[ACTIVE] = counts[HITS] = counts[HELD] = 0
    farthest = fastest = np.float32(0)
    for share in range(shares):
        farthest, fastest = max(farthest, extremes[share, 0]), max(fastest, extremes[share, 1])
    contact.moved[0], contact.moved[1] = np.sqrt(farthest), fastest
    # two nodes of a pair may both have come this far
    reach = contact.clearance + SLACK * contact.margin + np.float32(2) * contact.moved[0]
    last = np.int64(reach * np.float32(BINS) / (contact.clearance + contact.margin)) + 1
    counts[LIVE] = contact.bins[last if last < BINS else BINS]
    return int(counts[LIVE])


@njit(**INLINE)
def measure(
    before: Singles, searched: Singles, pairs: Ints32, apart: Singles, values: Singles, weights: Singles,
    limits: Singles, slack: Single, clearance: Single, i: int,
) -> None:  # fmt: skip
    """Closest points, gap and weight of pair i as the step began; each pair writes to its own place alone.

    The arrays are those of `Contact` by the same names, slack is SLACK of its margin: a parallel loop takes no tuples.
    A pair that was so far apart at the search that it cannot have come near enough to count is not looked at: what two
    triangles or edges come nearer by is at most what a corner of one has moved as a corner of the other sees it.
    """
    a, b, c, d = pairs[i, 0], pairs[i, 1], pairs[i, 2], pairs[i, 3]
    enough = max(limits[i] + slack, clearance)
    spare = (apart[i] - enough) * SURE
    if spare > 0:
        come = max(gone(before, searched, a, c), gone(before, searched, a, d))
        come = max(come, gone(before, searched, a if pairs[i, 4] == 0 else b, b if pairs[i, 4] == 0 else d))
        if pairs[i, 4] != 0:
            come = max(come, gone(before, searched, b, c))
        if come < spare * spare:
            values[i, 7], weights[i] = enough, np.float32(0)
            return
    out, weight = values[i], np.float32(1)
    if pairs[i, 4] == 0:
        node_triangle(before, pairs[i, 0], pairs[i, 1], pairs[i, 2], pairs[i, 3], out)
    else:
        weight = edge_edge(before, pairs[i, 0], pairs[i, 1], pairs[i, 2], pairs[i, 3], out)
    weights[i] = weight if out[7] < limits[i] + slack else np.float32(0)


@njit(**OPTIONS)
def _share_load(contact: Contact, minv: Singles) -> None:
    """Stiffness of each hit into `hit_values`, from how much contact each node takes part in."""
    load, pairs, values, hits = contact.load, contact.pairs, contact.values, contact.hits
    rows, source, weights, limits = contact.surface_nodes, contact.source, contact.weights, contact.limits
    stiffness = contact.hit_values
    one, slack, count = np.float32(1), SLACK * contact.margin, contact.counts[HITS]
    for h in range(count):
        for k in range(4):
            node = pairs[hits[h], k]
            load[node] = load[source[node]] = np.float32(0)
    for h in range(count):
        i = hits[h]
        share = weights[i] * min(one, (limits[i] + slack - values[i, 7]) / slack)
        for k in range(4):
            load[pairs[i, k]] += share * abs(values[i, k])
    for h in range(count):
        i = hits[h]
        crowd = np.float32(0)
        for k in range(4):
            node, b = pairs[i, k], abs(values[i, k])
            # an image takes part in what its source does, whether or not those pairs are looked at
            crowd += b * minv[rows[node]] * max(load[source[node]], b)
        stiffness[h, 0] = STIFFNESS * weights[i] / crowd if crowd > 0 else np.float32(0)


@njit(**OPTIONS)
def _look_around(contact: Contact) -> None:
    """How far each node began the step from what it might touch, into `room`."""
    room, pairs, values, source, clearance = (
        contact.room,
        contact.pairs,
        contact.values,
        contact.source,
        contact.clearance,
    )
    room[:] = clearance
    for i in range(contact.counts[LIVE]):
        if values[i, 7] >= clearance:
            continue
        for k in range(4):
            # an image goes as far as what it is an image of
            node = source[pairs[i, k]]
            room[node] = min(room[node], values[i, 7])


@njit(**OPTIONS)
def _hold(contact: Contact, x: Singles, v: Singles) -> None:
    """Cut short what went farther in this step than it may; see SAFE."""
    reads, rows, room, source = contact.reads, contact.surface_nodes, contact.room, contact.source
    before = contact.before
    for place in range(contact.counts[READS]):
        i = reads[place]
        row, most = rows[i], SAFE * room[source[i]]
        square = v[row, 0] * v[row, 0] + v[row, 1] * v[row, 1] + v[row, 2] * v[row, 2]
        if square > most * most:
            share = most / np.sqrt(square)
            for k in range(3):
                v[row, k] *= share
                x[row, k] = before[i, k] + v[row, k]


@njit(**OPTIONS)
def _hasty(contact: Contact, v: Singles, square: Single) -> bool:
    """Whether a node that was pushed has more than this square of a speed."""
    pairs, hits, forces, rows = contact.pairs, contact.hits, contact.hit_values, contact.surface_nodes
    fastest = np.float32(0)
    for h in range(contact.counts[HITS]):
        if forces[h, 1] == 0:
            continue
        for k in range(4):
            row = rows[pairs[hits[h], k]]
            fastest = max(fastest, v[row, 0] * v[row, 0] + v[row, 1] * v[row, 1] + v[row, 2] * v[row, 2])
    return bool(fastest > square)


@njit(**OPTIONS)
def resolve(contact: Contact, x: Singles, v: Singles, minv: Singles) -> float:
    """Push what `measure` found too near; see `push_apart`. Where nothing may touch all go as they like."""
    counts, pairs, values, hits, forces = (
        contact.counts, contact.pairs, contact.values, contact.hits, contact.hit_values,
    )  # fmt: skip
    weights, limits, clearance = contact.weights, contact.limits, contact.clearance
    energy, rows, zero, half = np.float64(0), contact.surface_nodes, np.float32(0), np.float32(0.5)
    found = active = 0
    if counts[PAIRS] == 0:
        return energy
    nearest = clearance
    for i in range(counts[LIVE]):
        nearest = min(nearest, values[i, 7])
        hits[found] = i
        found += weights[i] > 0
    counts[HITS] = found
    # where the fastest is slow beside the least room, nobody's way is cut short
    square = UNHELD * (SAFE * nearest) ** 2
    if contact.moved[1] > square:
        counts[HELD] = 1
        _look_around(contact)
        _hold(contact, x, v)  # so that no push answers to where nothing can be
    _share_load(contact, minv)
    for h in range(found):
        i = hits[h]
        gap = speed = zero
        for k in range(4):
            row, b = rows[pairs[i, k]], values[i, k]
            for m in range(3):
                gap += b * values[i, 4 + m] * x[row, m]
                speed += b * values[i, 4 + m] * v[row, m]
        lacking, soft = limits[i] - gap, half * clearance
        forces[h, 1] = zero
        if lacking <= 0:
            continue
        begun = min(np.float32(1), lacking / soft)
        pushed = half * soft * begun * begun + max(lacking - soft, zero)
        forces[h, 1] = forces[h, 0] * max(pushed - DAMPING * begun * speed, zero)
        energy += forces[h, 0] * pushed * lacking * half
        active += 1
    counts[ACTIVE] += active
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
    if counts[HELD] == 0 and _hasty(contact, v, square):
        counts[HELD] = 1
        _look_around(contact)
    if counts[HELD] != 0:
        _hold(contact, x, v)
    return energy


@njit(**OPTIONS)
def prepare(contact: Contact, x: Singles, v: Singles) -> int:
    """Positions at the beginning of the step, before x moved by v, and the number of pairs near enough to `measure`."""
    counts = contact.counts
    counts[LIVE] = counts[ACTIVE] = counts[HITS] = counts[HELD] = 0
    if counts[PAIRS] == 0:
        return 0
    depart(
        contact.before, contact.searched, contact.surface_nodes, contact.reads, x, v, contact.extremes, 0, 0,
        counts[READS],
    )  # fmt: skip
    return int(near(contact, 1))


@njit(**OPTIONS)
def push_apart(contact: Contact, x: Singles, v: Singles, minv: Singles) -> float:
    """Push touching skin apart; call in every step right after x has moved by v, and `find_pairs` every so often.

    x, v (nn, 4) float32 are changed in place; minv (nn,) float32 inverse scaled masses (0: fixed). All gaps are taken
    before any push, so the order of pairs does not matter. Returns the contact energy in units of the scaled masses.
    """
    live, slack = prepare(contact, x, v), SLACK * contact.margin
    for i in range(live):
        measure(
            contact.before, contact.searched, contact.pairs, contact.apart, contact.values, contact.weights,
            contact.limits, slack, contact.clearance, i,
        )  # fmt: skip
    energy: float = resolve(contact, x, v, minv)
    return energy
