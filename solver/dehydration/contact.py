"""Self-contact of the skin for an explicit march with unit steps: impulses that keep skin from crossing skin.

The march moves v and then x by v; `push_apart` adds the same increment to both:

    dx_j = dv_j = minv_j sum_c k_c lacking_c b_cj n_c,   lacking_c = clearance - g_c > 0,

with b = +1 at the node and minus the shape functions at the quad's corners. Foot points and directions n are those at
the beginning of the step, the gap g is the one they predict for its end. So the penalty acts as backward Euler along
the normal, with stiffness P^-1 - 1 where P = 1 - M^-1 B k B^T: it dissipates, and it is stable for every elastic step
below its own limit as long as the eigenvalues of M^-1 B k B^T stay within [0, 1]. The turning of the normals stays
explicit, as in any leapfrog step: its stiffness is indefinite, and backward Euler would feed what it pushes apart
(pressed undamped sheets then flutter). The eigenvalues are within [0, 1]: with

    k_c = STIFFNESS r_c / sum_j |b_cj| minv_j S_j,   S_j = sum_d r_d |b_dj|,   r_c = min(1, 2 lacking_c / clearance),

over all active contacts, the rows of k (B^T M^-1 B) weighted by r sum to at most STIFFNESS <= 1 (Gershgorin). A lone
contact is resolved in one step, crowded nodes share, and a contact that begins takes its share gradually, so that it
does not jolt its neighbours. No tuning by mass or mesh is left.

Forces act along the line from the foot to the node, so linear and angular momentum balance to round-off; there is no
friction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact_data import (
    ACTIVE,
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
"""Share of the stiffness that is stable for certain; pressed plates stay quiet up to 1.3 and are thrown apart at 4."""
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
def _collect(contact: Contact, x: Singles, v: Singles) -> int:
    """Nearest quad of each node as the step began, where its end may touch it, into `hits`. Returns how many."""
    active, last = 0, -1
    one, quarter = np.float32(1), np.float32(0.25)
    same = np.float32(1e-4) * contact.size
    on_skin = np.float32(1e-3) * contact.size
    exact = np.float32(1e-7) * contact.size * contact.size
    # what is farther away than this was not in reach of one step
    clearance, depth = contact.clearance + np.float32(0.25) * contact.margin, contact.depth
    reach = max(clearance * clearance, depth * depth)
    surface_nodes, corners = contact.surface_nodes, contact.quad_nodes
    hits, values, feet = contact.hits, contact.hit_values, contact.feet
    best = seen = np.float32(0)
    for pair in range(contact.counts[PAIRS]):
        node, quad = contact.pair_nodes[pair], contact.pair_quads[pair]
        a, b, c, d = corners[quad, 0], corners[quad, 1], corners[quad, 2], corners[quad, 3]
        row = surface_nodes[node]
        s, t, ex, ey, ez, square, nx, ny, nz = closest(x, v, row, a, b, c, d, feet[pair, 0], feet[pair, 1], exact)
        feet[pair, 0], feet[pair, 1] = s, t
        if not square < reach:
            continue
        distance = np.sqrt(square)
        inverse = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-30))
        nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
        height = -(ex * nx + ey * ny + ez * nz)
        gap = distance if height >= 0 else -distance
        if node == last:
            # quads that share the closest edge are equally far: the one seen most squarely knows the side
            nearer = distance - abs(best)
            if abs(nearer) < same and (gap >= 0) != (best >= 0):
                if abs(height) <= seen:
                    continue
            elif nearer >= 0:
                continue
        elif last >= 0 and _touches(best, seen, clearance, depth, on_skin):
            active += 1
        last, best, seen = node, gap, abs(height)
        # along the line from foot to node no torque is left over; on the skin itself that line has no direction
        if distance > on_skin:
            nx, ny, nz = -ex / gap, -ey / gap, -ez / gap
        hits[active, 0], hits[active, 1] = node, quad
        values[active, 0], values[active, 1] = quarter * (one - s) * (one - t), quarter * (one + s) * (one - t)
        values[active, 2], values[active, 3] = quarter * (one + s) * (one + t), quarter * (one - s) * (one + t)
        values[active, 4], values[active, 5], values[active, 6], values[active, 7] = nx, ny, nz, gap
    if last >= 0 and _touches(best, seen, clearance, depth, on_skin):
        active += 1
    return active


@njit(**OPTIONS)
def _predict(contact: Contact, v: Singles, hits: int) -> tuple[int, Single]:
    """Gaps at the end of the step, along the directions of its beginning; keeps the contacts that lack clearance.

    Returns how many, and the deepest penetration at the beginning.
    """
    rows, places, quads, values = contact.surface_nodes, contact.hits, contact.quad_nodes, contact.hit_values
    active, deepest = 0, np.float32(0)
    for c in range(hits):
        row, quad = rows[places[c, 0]], places[c, 1]
        nx, ny, nz = values[c, 4], values[c, 5], values[c, 6]
        speed = nx * v[row, 0] + ny * v[row, 1] + nz * v[row, 2]
        for k in range(4):
            corner = quads[quad, k]
            speed -= values[c, k] * (nx * v[corner, 0] + ny * v[corner, 1] + nz * v[corner, 2])
        deepest = max(deepest, -values[c, 7])
        lacking = contact.clearance - values[c, 7] - speed
        if lacking <= 0:
            continue
        places[active, 0], places[active, 1] = places[c, 0], quad
        for k in range(8):
            values[active, k] = values[c, k]
        # an impulse that lifts a node out of half an element at once would throw it: lead it out at a bounded speed
        values[active, 8] = max(min(lacking, contact.recovery - speed), np.float32(0))
        values[active, 9] = min(np.float32(1), np.float32(2) * lacking / contact.clearance)
        active += 1
    return active, deepest


@njit(**OPTIONS)
def _share_load(contact: Contact, active: int) -> None:
    """S_j, how much contact each node takes part in: as a node r_c, as a corner r_c times its weight."""
    load, hits, values, quads = contact.load, contact.hits, contact.hit_values, contact.quads
    load[:] = np.float32(0)
    for c in range(active):
        load[hits[c, 0]] += values[c, 9]
        for k in range(4):
            load[quads[hits[c, 1], k]] += values[c, 9] * values[c, k]


@njit(**OPTIONS)
def push_apart(contact: Contact, x: Singles, v: Singles, minv: Singles) -> tuple[Single, float]:
    """Push touching skin apart; call in every step right after x has moved by v.

    x, v (nn, 4) float32 are changed in place; minv (nn,) float32 inverse scaled masses (0: fixed). All gaps are taken
    before any push, so the order of the pairs does not matter. Returns the deepest penetration as the step began (0 if
    none; a gap below the clearance but positive is none) and the contact energy, sum of k lacking^2 / 2 in units of
    the scaled masses.
    """
    contact.counts[ACTIVE] = 0
    energy = np.float64(0)
    if contact.counts[PAIRS] == 0:
        return np.float32(0), energy
    active, deepest = _predict(contact, v, _collect(contact, x, v))
    contact.counts[ACTIVE] = active
    _share_load(contact, active)
    rows, hits, quads, values = contact.surface_nodes, contact.hits, contact.quads, contact.hit_values
    corners, load = contact.quad_nodes, contact.load
    for c in range(active):
        node, quad = hits[c, 0], hits[c, 1]
        row = rows[node]
        crowd = minv[row] * load[node]
        for k in range(4):
            crowd += values[c, k] * minv[corners[quad, k]] * load[quads[quad, k]]
        impulse = STIFFNESS * values[c, 9] * values[c, 8] / crowd if crowd > 0 else np.float32(0)
        energy += 0.5 * impulse * values[c, 8]
        for i in range(3):
            push = impulse * values[c, 4 + i]
            x[row, i] += minv[row] * push
            v[row, i] += minv[row] * push
            for k in range(4):
                corner = corners[quad, k]
                x[corner, i] -= values[c, k] * minv[corner] * push
                v[corner, i] -= values[c, k] * minv[corner] * push
    return deepest, energy
