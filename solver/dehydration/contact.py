"""Self-contact of the skin for an explicit march with unit steps: impulses that keep skin from crossing skin.

The march moves x and v to trial values, then `push_apart` adds the same increment to both:

    x, v += P'(lacking),   lacking_c = clearance - g_c > 0,   dx_j = minv_j sum_c k_c lacking_c b_cj n_c

with b = +1 at the node and minus the shape functions at the quad's corners. An increment on *trial* positions is a
backward-Euler penalty of stiffness (P^-1 - I) with P = I - M^-1 B k B^T: it dissipates, and it is stable for every
elastic step below its own limit as long as the eigenvalues of M^-1 B k B^T stay within [0, 1]. They do: with

    k_c = stiffness / sum_j |b_cj| minv_j S_j,   S_j = sum_d |b_dj| over all active contacts,

every row of k (B^T M^-1 B) sums to at most `stiffness` <= 1 (Gershgorin). A lone contact is resolved in one step,
crowded nodes share. No tuning by mass or mesh is left. Forces act along the line from the foot to the node, so linear
and angular momentum balance to round-off; there is no friction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.dehydration.contact_search import (
    ACTIVE,
    NEEDED,
    OPPOSED,
    OPTIONS,
    PAIRS,
    SEARCHES,
    Contact,
    find_pairs,
    grow,
    make_contact,
)

__all__ = [
    "ACTIVE",
    "NEEDED",
    "OPPOSED",
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
"""Share of the stable stiffness that is used; stable up to 1 whatever the elastic step (see the module's text)."""
SQUARELY = np.float32(0.7)
"""Least cosine between a penetrated quad's normal and the line to its closest point."""


@njit(**OPTIONS)
def closest(x, row, a, b, c, d, u, v, exact):
    """Closest point of a bilinear quad to a node, from a first guess u, v (the last result, if there is one).

    x (nn, >= 3) float32; row of the node, a, b, c, d rows of the corners. A projected Newton method in the square
    [-1, 1]^2 down to a squared slope `exact` (length squared); it needs no step at all while nothing moves. Returns
    u, v, the foot minus the node (3), its squared length and the quad's normal at the foot, not normalised (3).
    """
    zero, one, quarter = np.float32(0), np.float32(1), np.float32(0.25)
    px, py, pz = x[row, 0], x[row, 1], x[row, 2]
    # foot - node = m + u s + v t + u v w; corners relative to the node keep float32's digits
    ax, ay, az = x[a, 0] - px, x[a, 1] - py, x[a, 2] - pz
    bx, by, bz = x[b, 0] - px, x[b, 1] - py, x[b, 2] - pz
    cx, cy, cz = x[c, 0] - px, x[c, 1] - py, x[c, 2] - pz
    dx, dy, dz = x[d, 0] - px, x[d, 1] - py, x[d, 2] - pz
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
def _touches(gap, height, clearance, depth):
    """Whether a node's nearest quad is touched: closer than the clearance, or penetrated but not through a part.

    Behind a quad only where it is seen squarely: a node past a ridge is nearest to its edge, and behind the plane of
    the far flank without being inside.
    """
    if gap >= clearance or gap < -depth:
        return False
    return gap >= 0 or height > -SQUARELY * gap


@njit(**OPTIONS)
def _collect(contact, x):
    """Active contacts into `hits`: the nearest quad of each node. Returns how many."""
    active, last = 0, -1
    one, quarter = np.float32(1), np.float32(0.25)
    same = np.float32(1e-4) * contact.size
    on_skin = np.float32(1e-3) * contact.size
    exact = np.float32(1e-7) * contact.size * contact.size
    clearance, depth = contact.clearance, contact.depth
    reach = max(clearance * clearance, depth * depth)
    surface_nodes, corners = contact.surface_nodes, contact.quad_nodes
    hits, values, feet = contact.hits, contact.hit_values, contact.feet
    best = seen = np.float32(0)
    for pair in range(contact.counts[PAIRS]):
        node, quad = contact.pair_nodes[pair], contact.pair_quads[pair]
        a, b, c, d = corners[quad, 0], corners[quad, 1], corners[quad, 2], corners[quad, 3]
        u, v, ex, ey, ez, square, nx, ny, nz = closest(
            x, surface_nodes[node], a, b, c, d, feet[pair, 0], feet[pair, 1], exact
        )
        feet[pair, 0], feet[pair, 1] = u, v
        if not square < reach:
            continue
        distance = np.sqrt(square)
        inverse = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-30))
        nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
        height = -(ex * nx + ey * ny + ez * nz)
        gap = distance if height >= 0 else -distance
        if node == last:
            # quads that share the closest edge are equally far; the one seen most squarely knows the side
            nearer = distance - abs(best)
            if nearer > same or (nearer > -same and abs(height) <= seen):
                continue
        elif last >= 0 and _touches(best, seen, clearance, depth):
            active += 1
        last, best, seen = node, gap, abs(height)
        # along the line from foot to node no torque is left over; on the skin itself that line has no direction
        if distance > on_skin:
            nx, ny, nz = -ex / gap, -ey / gap, -ez / gap
        hits[active, 0], hits[active, 1] = node, quad
        values[active, 0], values[active, 1] = quarter * (one - u) * (one - v), quarter * (one + u) * (one - v)
        values[active, 2], values[active, 3] = quarter * (one + u) * (one + v), quarter * (one - u) * (one + v)
        values[active, 4], values[active, 5], values[active, 6], values[active, 7] = nx, ny, nz, gap
    if last >= 0 and _touches(best, seen, clearance, depth):
        active += 1
    return active


@njit(**OPTIONS)
def _share_load(contact, active):
    """S_j: how much contact each node takes part in, as a node (1) and as a corner (its weight)."""
    for c in range(active):
        contact.load[contact.hits[c, 0]] = np.float32(0)
        for k in range(4):
            contact.load[contact.quads[contact.hits[c, 1], k]] = np.float32(0)
    for c in range(active):
        contact.load[contact.hits[c, 0]] += np.float32(1)
        for k in range(4):
            contact.load[contact.quads[contact.hits[c, 1], k]] += contact.hit_values[c, k]


@njit(**OPTIONS)
def push_apart(contact, x, v, minv):
    """Push touching skin apart; call in every step after positions and velocities have moved.

    x, v (nn, 4) float32 are changed in place; minv (nn,) float32 inverse scaled masses (0: fixed). All gaps are taken
    before any push, so the order of the pairs does not matter. Returns the deepest penetration (0 if none; a gap below
    the clearance but positive is none) and the contact energy, sum of k lacking^2 / 2 in units of the scaled masses.
    """
    contact.counts[ACTIVE] = 0
    deepest, energy = np.float32(0), np.float64(0)
    if contact.counts[PAIRS] == 0:
        return deepest, energy
    active = _collect(contact, x)
    contact.counts[ACTIVE] = active
    _share_load(contact, active)
    for c in range(active):
        node, quad = contact.hits[c, 0], contact.hits[c, 1]
        values = contact.hit_values[c]
        row = contact.surface_nodes[node]
        deepest = max(deepest, -values[7])
        crowd = minv[row] * contact.load[node]
        speed = v[row, 0] * values[4] + v[row, 1] * values[5] + v[row, 2] * values[6]
        for k in range(4):
            corner = contact.quad_nodes[quad, k]
            crowd += values[k] * minv[corner] * contact.load[contact.quads[quad, k]]
            speed -= values[k] * (v[corner, 0] * values[4] + v[corner, 1] * values[5] + v[corner, 2] * values[6])
        # an impulse that lifts a node out of half an element at once would throw it: lead it out at a bounded speed
        lacking = max(min(contact.clearance - values[7], contact.recovery - speed), np.float32(0))
        values[8] = STIFFNESS * lacking / crowd if crowd > 0 else np.float32(0)
        energy += 0.5 * values[8] * lacking
    for c in range(active):
        node, quad = contact.hits[c, 0], contact.hits[c, 1]
        values = contact.hit_values[c]
        row = contact.surface_nodes[node]
        share = minv[row] * values[8]
        for i in range(3):
            step = share * values[4 + i]
            x[row, i] += step
            v[row, i] += step
        for k in range(4):
            corner = contact.quad_nodes[quad, k]
            share = -values[k] * minv[corner] * values[8]
            for i in range(3):
                step = share * values[4 + i]
                x[corner, i] += step
                v[corner, i] += step
    return deepest, energy
