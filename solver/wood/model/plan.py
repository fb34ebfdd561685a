"""The order in which the explicit kernels read edges and bonds: whole rods in parts, bonds sorted by their edges.

A part is a few whole rods, so that what its edges and bonds read and write stays in the first caches, and the bonds of
an edge follow each other. What is broken is left out. Nothing here depends on positions: a plan holds until a break.
Making one takes as long as a step or two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arrays import Bonds, Rods
from .curves import slopes

__all__ = [
    "BOW",
    "COSINE",
    "CURVE",
    "FREE",
    "KEEP",
    "LONG",
    "RADIUS",
    "RATE",
    "REST",
    "ROWS",
    "SHARE",
    "SHEAR",
    "SPRING",
    "STIFF",
    "TENSION",
    "WEAK",
    "Plan",
    "plan_for",
]

#: Rows of a part's edges: rest length [m]; k [N], 0 if it is dead; 4 alpha / span [N m] and 4 / span [1/m] of the hinge
#: behind an edge, 0 where none is whole; radius [m]; 1 / the least strain that it bears; length over REST at which it
#: bears nothing; the eight of `curves.slopes`.
REST, TENSION, STIFF, BOW, RADIUS, WEAK, FREE, CURVE = range(8)
_EDGE = CURVE + 8

#: Rows of a part's bonds: share; 1 / rest [1/m]; spring k [N]; -2 S over the square of twice the length of the bond's
#: edge [N/m]; slope at rest times twice this length [m]; 1 less its damage, which a fracture pass writes anew; this
#: length [m].
SHARE, RATE, SPRING, SHEAR, COSINE, KEEP, LONG = range(7)
_BOND = LONG + 1
#: The fewest edges of a part, but for the last: of 2,000 rods 128 cost a tenth more; a call of the bonds' loops, .5 us.
_PART = 256
#: Numbers in a line of the cache: rows of parts begin on one.
_LINE = 8
#: Rows that the kernels keep of a part's edges, see `forces.rods`.
ROWS = 35


class Plan(NamedTuple):
    """Parts (p,) of at most m edges and w bonds. Lanes count the bonds of a part."""

    part: np.ndarray  # (p + 1,) uint32 first edge
    a: np.ndarray  # (e,) uint32 first vertex
    b: np.ndarray  # (e,) uint32 second vertex
    edge: np.ndarray  # (p, 15, m) what an edge is made of, in the rows above
    lane: np.ndarray  # (e + p,) uint32 first lane of an edge's bonds; a part has one entry more, its end
    seat: np.ndarray  # (p, w) uint32 seat of a bond
    law: np.ndarray  # (p, 7, w) what a bond is made of, in the rows above
    origin: np.ndarray  # (p, w) uint32 the bond's number
    stub: np.ndarray  # (s,) uint32 edges of the seats that follow those in the middles of edges
    at: np.ndarray  # (s,) and where on them


@njit(cache=True, error_model="numpy")
def _parts(rods: Rods) -> np.ndarray:
    """Return the first edges of parts. Rods are chains of edges with neighbouring numbers, joined by hinges."""
    count = len(rods.a)
    inside = np.zeros(count, np.uint8)
    for h in range(len(rods.after)):
        inside[rods.after[h]] = 1
    found = np.zeros(count + 1, np.int64)
    parts = 0
    for e in range(count):
        if inside[e] == 0 and e - found[parts] >= _PART:
            parts += 1
            found[parts] = e
    found[parts + 1] = count
    return found[: parts + 2].copy()


@njit(cache=True, error_model="numpy")
def _edges(rods: Rods, strength: np.ndarray, part: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what edges are made of (p, rows, m), the first lanes of their bonds (e + p,) and their parts (e,).

    first (e + 1,): of every edge's bonds, counted through.
    """
    parts = len(part) - 1
    most = 1
    for p in range(parts):
        most = max(most, part[p + 1] - part[p])
    edge = np.zeros((parts, _EDGE, (most + _LINE - 1) // _LINE * _LINE))
    curve = slopes(rods)
    lane = np.zeros(len(rods.a) + parts, np.uint32)
    own = np.zeros(len(rods.a), np.int64)
    for p in range(parts):
        for e in range(part[p], part[p + 1]):
            own[e] = p
            m = e - part[p]
            edge[p, REST, m] = rods.rest[e]
            edge[p, RADIUS, m] = rods.radius[e]
            edge[p, FREE, m] = rods.free[e]
            edge[p, CURVE:, m] = curve[:, e]
            if rods.alive[e] == 1 and rods.k[e] > 0.0:
                edge[p, TENSION, m] = rods.k[e]
                edge[p, WEAK, m] = 1.0 / strength[e].min()
            lane[e + p] = first[e] - first[part[p]]
        lane[part[p + 1] + p] = first[part[p + 1]] - first[part[p]]
    for h in range(len(rods.before)):
        if rods.whole[h] == 1:
            e = rods.before[h]
            edge[own[e], STIFF, e - part[own[e]]] = 4.0 * rods.alpha[h] / rods.span[h]
            edge[own[e], BOW, e - part[own[e]]] = 4.0 / rods.span[h]
    return edge, lane, own


@njit(cache=True, error_model="numpy")
def plan_for(rods: Rods, bonds: Bonds, strength: np.ndarray) -> Plan:
    """Return the plan of what is whole; strength (e, samples): strain that each place bears."""
    edges = len(rods.a)
    part = _parts(rods)
    parts = len(part) - 1
    # a counting sort: stable, so that the order does not depend on what was broken before
    first = np.zeros(edges + 1, np.int64)
    for n in range(len(bonds.j)):
        if bonds.on[n] > 0:
            first[bonds.j[n] + 1] += 1
    for e in range(edges):
        first[e + 1] += first[e]
    edge, lane, own = _edges(rods, strength, part, first)
    wide = 1
    for p in range(parts):
        wide = max(wide, first[part[p + 1]] - first[part[p]])
    wide = (wide + _LINE - 1) // _LINE * _LINE
    seat = np.zeros((parts, wide), np.uint32)
    moved = np.flatnonzero((bonds.on > 0) & (bonds.at != 0.5))
    stubs = 0
    origin = np.zeros((parts, wide), np.uint32)
    law = np.zeros((parts, _BOND, wide))
    free = first[:edges].copy()
    for n in range(len(bonds.j)):
        if bonds.on[n] == 0:
            continue
        j = bonds.j[n]
        p = own[j]
        m = free[j] - first[part[p]]
        free[j] += 1
        seat[p, m] = bonds.i[n]
        if bonds.at[n] != 0.5:
            seat[p, m] = edges + stubs
            stubs += 1
        origin[p, m] = n
        law[p, SHARE, m] = bonds.share[n]
        law[p, RATE, m] = 1.0 / bonds.rest[n]
        law[p, SPRING, m] = bonds.k[n]
        law[p, SHEAR, m] = -0.5 * bonds.s[n] / rods.rest[j] ** 2
        law[p, COSINE, m] = 2.0 * bonds.cosine[n] * rods.rest[j]
        law[p, LONG, m] = rods.rest[j]
        law[p, KEEP, m] = 1.0 - bonds.damage[n]
    return Plan(
        part.astype(np.uint32),
        rods.a.astype(np.uint32),
        rods.b.astype(np.uint32),
        edge,
        lane,
        seat,
        law,
        origin,
        bonds.i[moved].astype(np.uint32),
        bonds.at[moved],
    )
