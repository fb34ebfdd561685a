"""Self-contact of the skin for an explicit march with unit steps: springs that keep skin from crossing skin.

The march moves v and then x by v; `push_apart` adds the same increment to both:

    dx_j = dv_j = minv_j sum_c f_c b_cj n_c,   f_c = k_c phi(lacking_c) - damping,   lacking_c = clearance - g_c,

with b = +1 at the node and minus the shape functions at the quad's corners. Feet and directions n are those at the
beginning of the step, the gap g is the one they give for its end: along the normal the penalty acts as backward Euler.
The turning of the normals stays explicit.

phi is 0 without lack, quadratic up to half the clearance and linear beyond, so a contact that begins does not jolt; it
ends at a limit that leads out, rather than throws, what began deep inside. A contact takes its closing speed out.

What touches is continuous as well (`touch`).

The eigenvalues of M^-1 B k B^T stay within [0, STIFFNESS], clear of what the masses leave to the step: with

    k_c = STIFFNESS / sum_j |b_cj| minv_j S_j,   S_j = sum_d r_d |b_dj|,

over all quads within reach, touched or not, the rows of k (B^T M^-1 B) weighted by r sum to at
most STIFFNESS (Gershgorin). r rises from 0 for those farthest off, so that none appears with a jump. A lone contact
is resolved in about one step, crowded nodes share. No tuning by mass or mesh is left.

Forces act along the line from the foot to the node, so linear and angular momentum balance to round-off; there is no
friction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact.data import ACTIVE, HITS, OPTIONS, PAIRS, Contact, Single, Singles
from solver.dehydration.contact.touch import SLACK, collect

__all__ = ["push_apart"]

STIFFNESS = np.float32(1.0)
"""Of the 4 that a unit step carries, the masses leave 2 to contact."""
DAMPING = np.float32(1.0)
"""Share of a contact's closing speed that each step takes out; 0.3 let walls pulled together cross by 0.15 edges."""


@njit(**OPTIONS)
def _share_load(contact: Contact, hits: int, minv: Singles) -> None:
    """Stiffness of each hit into `hit_values`, from how much contact each node takes part in."""
    load, places, values, quads = contact.load, contact.hits, contact.hit_values, contact.quads
    rows, corners = contact.surface_nodes, contact.quad_nodes
    one, slack = np.float32(1), SLACK * contact.margin
    load[:] = np.float32(0)
    for c in range(hits):
        share = values[c, 11] * min(one, (contact.clearance + slack - values[c, 7]) / slack)
        load[places[c, 0]] += share
        for k in range(4):
            load[quads[places[c, 1], k]] += share * values[c, k]
    for c in range(hits):
        node, quad = places[c, 0], places[c, 1]
        crowd = minv[rows[node]] * max(load[node], one)
        for k in range(4):
            crowd += values[c, k] * minv[corners[quad, k]] * max(load[quads[quad, k]], values[c, k])
        values[c, 8] = STIFFNESS * values[c, 11] / crowd if crowd > 0 else np.float32(0)


@njit(**OPTIONS)
def push_apart(contact: Contact, x: Singles, v: Singles, minv: Singles) -> tuple[Single, float]:
    """Push touching skin apart; call in every step right after x has moved by v, and `find_pairs` every so often.

    x, v (nn, 4) float32 are changed in place; minv (nn,) float32 inverse scaled masses (0: fixed). All gaps are taken
    before any push, so the order of the pairs does not matter. Returns the deepest penetration (0 if none; a gap below
    the clearance but positive is none) and the contact energy in units of the scaled masses.
    """
    counts = contact.counts
    energy, deepest = np.float64(0), np.float32(0)
    counts[ACTIVE] = 0
    if counts[PAIRS] == 0:
        return deepest, energy
    counts[HITS] = collect(contact, x, v)
    _share_load(contact, counts[HITS], minv)
    rows, hits, values, corners = contact.surface_nodes, contact.hits, contact.hit_values, contact.quad_nodes
    zero, half = np.float32(0), np.float32(0.5)
    for c in range(counts[HITS]):
        row, quad = rows[hits[c, 0]], hits[c, 1]
        gap = speed = zero
        for i in range(3):
            away, rate = x[row, i], v[row, i]
            for k in range(4):
                away -= values[c, k] * x[corners[quad, k], i]
                rate -= values[c, k] * v[corners[quad, k], i]
            gap += values[c, 4 + i] * away
            speed += values[c, 4 + i] * rate
        deepest = max(deepest, -gap)
        lacking, soft = values[c, 10] - gap, half * contact.clearance
        values[c, 9] = zero
        if lacking <= 0:
            continue
        begun = min(np.float32(1), lacking / soft)
        pushed = min(half * soft * begun * begun + max(lacking - soft, zero), contact.recovery)
        values[c, 9] = values[c, 8] * max(pushed - DAMPING * begun * speed, zero)
        energy += values[c, 8] * pushed * lacking * half
        counts[ACTIVE] += 1
    for c in range(counts[HITS]):
        if values[c, 9] == 0:
            continue
        row, quad = rows[hits[c, 0]], hits[c, 1]
        for i in range(3):
            push = values[c, 9] * values[c, 4 + i]
            x[row, i] += minv[row] * push
            v[row, i] += minv[row] * push
            for k in range(4):
                corner = corners[quad, k]
                x[corner, i] -= values[c, k] * minv[corner] * push
                v[corner, i] -= values[c, k] * minv[corner] * push
    return deepest, energy
