"""Conjugate gradients for bodies that touch: blocks, a term of rank one for each pair, and rigid motions to go ahead.

The matrix is one of 3 x 3 blocks less, for each pair of bodies, f f^T / k, where f (of the points that lean on the
plane between them) is their stiffness along its way and k the sum of it: the plane gives way. Preconditioned by each
point's own block plus the six rigid motions of each body, with the stiffness that contacts and springs give these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from ...linalg.krylov import times

__all__ = ["Ahead", "Ranks", "applied", "coarse", "solved"]


class Ranks(NamedTuple):
    """Points (m) that lean on planes, of which pair (m), their stiffness (m) and ways (m, 3); sums by pair (c)."""

    point: Ints
    pair: Ints
    stiff: Floats
    way: Floats
    total: Floats


class Ahead(NamedTuple):
    """What preconditions: inverses of blocks (n, 3, 3) and of the coarse matrix (6 b, 6 b), arms (n, 3), bodies."""

    inverse: Floats
    rigid: Floats
    about: Floats
    bodies: int


@njit(cache=True)
def _ranked(point: Ints, pair: Ints, stiff: Floats, way: Floats, total: Floats, p: Floats, y: Floats) -> None:
    mean = np.zeros(len(total))
    for m in range(len(point)):
        i = point[m]
        mean[pair[m]] += stiff[m] * (way[m, 0] * p[i, 0] + way[m, 1] * p[i, 1] + way[m, 2] * p[i, 2])
    for m in range(len(point)):
        i, part = point[m], stiff[m] * mean[pair[m]] / total[pair[m]]
        for c in range(3):
            y[i, c] -= part * way[m, c]


def applied(indptr: Ints, indices: Ints, a: Floats, ranks: Ranks, p: Floats) -> Floats:
    """Return the matrix times p (n, 3)."""
    y = times(indptr, indices, a, p)
    _ranked(*ranks, p, y)
    return y


@njit(cache=True)
def _motion(k: int, about: Floats) -> Floats:
    """Return how a point moves in rigid motion k of 6, three ways and three turns (3)."""
    out = np.zeros(3)
    if k < 3:
        out[k] = 1.0
    else:
        i, j = (k - 2) % 3, (k - 1) % 3
        # the unit vector k - 3 times the arm
        out[j] = about[i]
        out[i] = -about[j]
    return out


@njit(cache=True)
def coarse(
    springs: Floats,
    about: Floats,
    bodies: int,
    point: Ints,
    pair: Ints,
    stiff: Floats,
    way: Floats,
    total: Floats,
    body: Ints,
) -> Floats:
    """Return how stiff rigid motions are (6 b, 6 b): springs (n, 3, 3) at points `about` their bodies' middles, pairs.

    body (c, 2): the pairs' bodies.
    """
    size = len(about) // bodies
    found = np.zeros((6 * bodies, 6 * bodies))
    motions = np.empty((6, 3))
    for n in range(len(about)):
        at = 6 * (n // size)
        for k in range(6):
            motions[k] = _motion(k, about[n])
        for q in range(6):
            for i in range(3):
                pull = 0.0
                for j in range(3):
                    pull += springs[n, i, j] * motions[q, j]
                if pull != 0.0:
                    for k in range(6):
                        found[at + k, at + q] += motions[k, i] * pull
    mean = np.zeros((len(total), 12))
    felt = np.empty(6)
    for m in range(len(point)):
        c, n = pair[m], point[m]
        at, side = 6 * (n // size), 0 if n // size == body[c, 0] else 6
        for k in range(6):
            moved = _motion(k, about[n])
            felt[k] = moved[0] * way[m, 0] + moved[1] * way[m, 1] + moved[2] * way[m, 2]
        for k in range(6):
            mean[c, side + k] += stiff[m] * felt[k]
            for q in range(6):
                found[at + k, at + q] += stiff[m] * felt[k] * felt[q]
    for c in range(len(total)):
        if total[c] > 0:
            for k in range(12):
                for q in range(12):
                    row, column = 6 * body[c, k // 6] + k % 6, 6 * body[c, q // 6] + q % 6
                    found[row, column] -= mean[c, k] * mean[c, q] / total[c]
    return found


@njit(cache=True)
def _prepared(inverse: Floats, rigid: Floats, about: Floats, bodies: int, r: Floats, z: Floats) -> float:
    """Write the preconditioner times r to z (n, 3); return r . z."""
    size = len(r) // bodies
    load = np.zeros(6 * bodies)
    for n in range(len(r)):
        at = 6 * (n // size)
        for c in range(3):
            z[n, c] = inverse[n, c, 0] * r[n, 0] + inverse[n, c, 1] * r[n, 1] + inverse[n, c, 2] * r[n, 2]
            load[at + c] += r[n, c]
        load[at + 3] += about[n, 1] * r[n, 2] - about[n, 2] * r[n, 1]
        load[at + 4] += about[n, 2] * r[n, 0] - about[n, 0] * r[n, 2]
        load[at + 5] += about[n, 0] * r[n, 1] - about[n, 1] * r[n, 0]
    go = np.zeros(6 * bodies)
    for i in range(len(go)):
        for j in range(len(go)):
            go[i] += rigid[i, j] * load[j]
    total = 0.0
    for n in range(len(r)):
        at = 6 * (n // size)
        x, y, w = about[n]
        z[n, 0] += go[at] + go[at + 4] * w - go[at + 5] * y
        z[n, 1] += go[at + 1] + go[at + 5] * x - go[at + 3] * w
        z[n, 2] += go[at + 2] + go[at + 3] * y - go[at + 4] * x
        total += r[n, 0] * z[n, 0] + r[n, 1] * z[n, 1] + r[n, 2] * z[n, 2]
    return total


def solved(
    indptr: Ints,
    indices: Ints,
    a: Floats,
    ranks: Ranks,
    ahead: Ahead,
    b: Floats,
    start: Floats,
    tolerance: float,
    most: int,
) -> tuple[Floats, bool]:
    """Return x (n, 3) with A x = b from a start, and whether A curved upwards in all directions met.

    |b - A x| <= tolerance |b| in the preconditioner's norm, or after `most` iterations.
    """
    x, z = start.copy(), np.empty_like(b)
    first = _prepared(*ahead, b, z)
    r = b - applied(indptr, indices, a, ranks, x)
    rz = _prepared(*ahead, r, z)
    p = z.copy()
    for _ in range(most):
        if rz <= tolerance**2 * first or rz == 0:
            break
        ap = applied(indptr, indices, a, ranks, p)
        curve = float(np.sum(p * ap))
        if not curve > 0:
            return x, False
        x += rz / curve * p
        r -= rz / curve * ap
        before, rz = rz, _prepared(*ahead, r, z)
        p = z + rz / before * p
    return x, True
