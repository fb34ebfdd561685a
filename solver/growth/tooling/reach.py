"""What lies within reach of a tool along the surface."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...arrays import Floats, Ints
from ..state import State

__all__ = ["ways", "within"]


#: Along the surface, how many radii a tool reaches at most: what is nearer through the air is another part.
_DETOUR = 1.6


def within(state: State, sources: Ints, radius: float, away: Floats) -> Ints:
    """Return the vertices within reach of `sources` along the edges; away: (n,) distance from the tool in space."""
    edges = state.mesh.edges
    reach = _DETOUR * radius + 2 * float(_lengths(state.x, edges).mean())
    # ways along edges are no shorter than those through the air: beyond none leads through
    inside = away <= 1.001 * reach + away[sources].max()
    found = ways(state.x, edges[inside[edges[:, 0]] & inside[edges[:, 1]]], np.unique(sources), reach)
    return np.flatnonzero(found <= reach)


@njit(cache=True)
def _lengths(x: Floats, edges: Ints) -> Floats:
    found = np.empty(len(edges))
    for e in range(len(edges)):
        i, j = edges[e]
        found[e] = np.sqrt((x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2 + (x[i, 2] - x[j, 2]) ** 2)
    return found


@njit(cache=True)
def ways(x: Floats, edges: Ints, sources: Ints, limit: float) -> Floats:
    """Return the shortest ways (n,) along edges (e, 2) from sources; longer ones than the limit need not be."""
    found = np.full(len(x), np.inf)
    found[sources] = 0.0
    lengths = _lengths(x, edges)
    # shortened edge by edge until nothing changes (Bellman 1958): a few sweeps, to and fro
    changed, forth = True, True
    while changed:
        changed = False
        for step in range(len(edges)):
            e = step if forth else len(edges) - 1 - step
            i, j = edges[e]
            if found[i] + lengths[e] < found[j] and found[i] + lengths[e] <= limit:
                found[j] = found[i] + lengths[e]
                changed = True
            elif found[j] + lengths[e] < found[i] and found[j] + lengths[e] <= limit:
                found[i] = found[j] + lengths[e]
                changed = True
        forth = not forth
    return found
