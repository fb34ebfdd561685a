"""Self-contact of the skin for an explicit march with unit steps: springs that keep skin from crossing skin.

The march moves v and then x by v; `push_apart` adds the same increment to both:

    dx_j = dv_j = minv_j sum_c f_c b_cj n_c,   f_c = k_c phi(lacking_c) - damping,   lacking_c = clearance - g_c,

with b = +1 at the node and minus the shape functions at the quad's corners. Feet and directions n are those at the
beginning of the step, the gap g is the one they give for its end: along the normal the penalty acts as backward Euler.
The turning of the normals stays explicit.

phi is 0 without lack, quadratic up to half the clearance and linear beyond, so a contact that begins does not jolt; it
ends at a limit that leads out, rather than throws, what began deep inside. A contact takes its closing speed out.

What touches is continuous as well, or a settled stage would chatter: a node counts all quads nearly as close as the
closest, and walls on its other side (see `_weight`); next to its own quads the clearance begins at the shared edge; at
the mouth of a sulcus, where skin does not face skin yet, shallow contact counts all the same. Each of the three alone
left out-of-balance forces of 1e-2 to 1e-1 of the internal ones at s = 0.3 (preview, te = 0.04), together 1e-3.

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

from solver.dehydration.contact_data import (
    ACTIVE,
    ASKEW,
    HITS,
    NEEDED,
    OPTIONS,
    PAIRS,
    SEARCHES,
    Contact,
    Single,
    Singles,
    grow,
    make_contact,
)
from solver.dehydration.contact_search import find_pairs

__all__ = [
    "ACTIVE",
    "HITS",
    "NEEDED",
    "PAIRS",
    "SEARCHES",
    "Contact",
    "closest",
    "find_pairs",
    "grow",
    "make_contact",
    "push_apart",
]

STIFFNESS = np.float32(1.0)
"""Of the 4 that a unit step carries, the masses leave 2 to contact."""
DAMPING = np.float32(1.0)
"""Share of a contact's closing speed that each step takes out; 0.3 let walls pulled together cross by 0.15 edges."""
NEARLY = np.float32(0.25)
"""Of the clearance: how much farther than the closest quad another one still counts."""
OPENING = np.float32(0.3)
"""Least slope between a quad and the next that contact keeps open, where they share an edge."""
SLACK = np.float32(0.25)
"""Of the margin: how far beyond the clearance a quad begins to share the load."""
SQUARELY = np.float32(0.7)
"""Least cosine between a penetrated quad's normal and the line to its closest point."""


@njit(**OPTIONS)
def closest(
    x: Singles, step: Singles, row: int, a: int, b: int, c: int, d: int, u: Single, v: Single, exact: Single
) -> tuple[Single, Single, Single, Single, Single, Single, Single, Single, Single]:
    """Closest point of a bilinear quad to a node, from a first guess u, v (the last result, if there is one).

    Positions are x - step, both (nn, >= 3) float32; row of the node, a, b, c, d of the corners. A projected Newton
    method in the square [-1, 1]^2 down to a squared slope `exact` (length squared); it needs no step at all while
    nothing moves. Returns u, v, the foot minus the node (3), its squared length and the quad's normal at the foot, not
    normalised (3).
    """
    zero, one, quarter = np.float32(0), np.float32(1), np.float32(0.25)
    px, py, pz = x[row, 0] - step[row, 0], x[row, 1] - step[row, 1], x[row, 2] - step[row, 2]
    # foot - node = m + u s + v t + u v w; corners relative to the node keep float32's digits
    ax, ay, az = x[a, 0] - step[a, 0] - px, x[a, 1] - step[a, 1] - py, x[a, 2] - step[a, 2] - pz
    bx, by, bz = x[b, 0] - step[b, 0] - px, x[b, 1] - step[b, 1] - py, x[b, 2] - step[b, 2] - pz
    cx, cy, cz = x[c, 0] - step[c, 0] - px, x[c, 1] - step[c, 1] - py, x[c, 2] - step[c, 2] - pz
    dx, dy, dz = x[d, 0] - step[d, 0] - px, x[d, 1] - step[d, 1] - py, x[d, 2] - step[d, 2] - pz
    mx, my, mz = quarter * (ax + bx + cx + dx), quarter * (ay + by + cy + dy), quarter * (az + bz + cz + dz)
    sx, sy, sz = quarter * (bx + cx - ax - dx), quarter * (by + cy - ay - dy), quarter * (bz + cz - az - dz)
    tx, ty, tz = quarter * (cx + dx - ax - bx), quarter * (cy + dy - ay - by), quarter * (cz + dz - az - bz)
    wx, wy, wz = quarter * (ax + cx - bx - dx), quarter * (ay + cy - by - dy), quarter * (az + cz - bz - dz)
    for _ in range(8):
        ux, uy, uz = sx + v * wx, sy + v * wy, sz + v * wz
        vx, vy, vz = tx + u * wx, ty + u * wy, tz + u * wz
        ex, ey, ez = mx + u * sx + v * vx, my + u * sy + v * vy, mz + u * sz + v * vz
        uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
        gu, gv = ex * ux + ey * uy + ez * uz, ex * vx + ey * vy + ez * vz
        square = ex * ex + ey * ey + ez * ez
        # at a border the slope that points out of the square does not count
        free_u = abs(u) < one or gu * u > zero
        free_v = abs(v) < one or gv * v > zero
        done_u = not free_u or gu * gu < exact * uu
        done_v = not free_v or gv * gv < exact * vv
        if done_u and done_v:
            break
        if free_u and free_v:
            uv = ux * vx + uy * vy + uz * vz
            mixed = uv + ex * wx + ey * wy + ez * wz
            if mixed * mixed > np.float32(0.9) * uu * vv:
                mixed = uv
            inverse = one / (uu * vv - mixed * mixed + np.float32(1e-30))
            u -= (gu * vv - gv * mixed) * inverse
            v -= (gv * uu - gu * mixed) * inverse
        elif free_u:
            u -= gu / uu
        else:
            v -= gv / vv
        u, v = min(max(u, -one), one), min(max(v, -one), one)
    return u, v, ex, ey, ez, square, uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


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
def _collect(contact: Contact, x: Singles, v: Singles) -> int:
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
    counts[HITS] = _collect(contact, x, v)
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
