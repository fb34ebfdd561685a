"""Distances along a surface: from triangle to triangle, by the place from which a distance seems to come.

Each triangle tells a corner's distance from those of the other two: laid flat, they give the place where a point
source would be (Novotni and Klein 2002), or, of a line, the way in which a straight front goes (Kimmel and Sethian
1998). A way to a corner enters through the edge opposite to it in one of its triangles, or along an edge, so on what
can be laid flat distances from a point are exact, whatever the triangles; elsewhere they are as good as the mesh.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import Bools, Floats, Ints

__all__ = ["Distances", "carried", "distances"]

#: Least gain that counts, over the distance that is looked up to: rounding must not keep the sweeps going.
_GAIN = 1e-12


class Distances(NamedTuple):
    """Distances (n,), infinite beyond the limit, and where the way to each vertex comes from.

    parents: the two vertices (n, 2) between which it comes, seeds themselves. between: where (n,), 0 at the first.
    """

    away: Floats
    parents: Ints
    between: Floats


def distances(x: Floats, triangles: Ints, seeds: Ints, values: Floats, limit: float, straight: bool) -> Distances:
    """Return distances along a surface (n, 3) from seeds (m,), which have `values` (m,); ways beyond the limit are not.

    straight: whether fronts are lines, as about a curve, in place of circles about a point.
    """
    away, between = np.full(len(x), np.inf), np.zeros(len(x))
    np.minimum.at(away, seeds, values)
    parents = np.repeat(np.arange(len(x))[:, None], 2, axis=1)
    seeded = np.zeros(len(x), np.bool_)
    seeded[seeds] = True
    _sweep(x, triangles, seeded, limit, straight, away, parents, between)
    return Distances(np.where(away <= limit, away, np.inf), parents, between)


@njit(cache=True)
def _sweep(
    x: Floats,
    triangles: Ints,
    seeded: Bools,
    limit: float,
    straight: bool,
    away: Floats,
    parents: Ints,
    between: Floats,
) -> None:
    """Shorten distances triangle by triangle, to and fro, until nothing changes: none becomes too short on the way."""
    changed, forth = True, True
    while changed:
        changed = False
        for step in range(len(triangles)):
            f = step if forth else len(triangles) - 1 - step
            for corner in range(3):
                c = triangles[f, corner]
                a, b = triangles[f, (corner + 1) % 3], triangles[f, (corner + 2) % 3]
                if seeded[c] or min(away[a], away[b]) > limit:
                    continue
                found, share = _through(x[a], x[b], x[c], away[a], away[b], straight)
                if found < away[c] - _GAIN * limit:
                    away[c], between[c] = found, share
                    parents[c, 0], parents[c, 1] = a, b
                    changed = True
        forth = not forth


@njit(cache=True)
def _through(a: Floats, b: Floats, c: Floats, da: float, db: float, straight: bool) -> tuple[float, float]:
    """Return the distance of a corner c by those of a and b, and where its way crosses from a (0) to b (1)."""
    base, along, ac, bc = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        base += (b[k] - a[k]) ** 2
        along += (b[k] - a[k]) * (c[k] - a[k])
        ac += (c[k] - a[k]) ** 2
        bc += (c[k] - b[k]) ** 2
    base = np.sqrt(base)
    # c lies at (along, up) where a is the origin and b at (base, 0)
    along /= base
    up = np.sqrt(max(ac - along * along, 0.0))
    best, share = da + np.sqrt(ac), 0.0
    if db + np.sqrt(bc) < best:
        best, share = db + np.sqrt(bc), 1.0
    # a point that is no further from both ends together than they are from each other lies on the edge
    if abs(da - db) >= base or (not straight and da + db <= base):
        return best, share
    if straight:
        slope = (db - da) / base
        rise = np.sqrt(1.0 - slope * slope)
        found, crossing = da + slope * along + rise * up, along - slope * up / rise
    else:
        at = (da * da - db * db + base * base) / (2 * base)
        below = np.sqrt(max(da * da - at * at, 0.0))
        found = np.sqrt((along - at) ** 2 + (up + below) ** 2)
        crossing = at + (along - at) * below / (up + below)
    if 0.0 <= crossing <= base and found < best:
        return found, crossing / base
    return best, share


@njit(cache=True)
def carried(found: Distances, values: Floats) -> Floats:
    """Return the values (n, k) that go with distances from those of their seeds, which `values` has: along the ways."""
    told = values.copy()
    for c in np.argsort(found.away):
        if not np.isfinite(found.away[c]):
            break
        a, b, share = found.parents[c, 0], found.parents[c, 1], found.between[c]
        if a != b:
            for k in range(values.shape[1]):
                told[c, k] = (1 - share) * told[a, k] + share * told[b, k]
    return told
