"""Flips by the rest metric: long thin rest triangles are turned over.

Both triangles of an edge are unfolded into the plane of their rest metrics, taken apart there the other way, and the
new metrics read off. Where the rest state is flat and neighbours agree on their common edges, that is the same rest
state; elsewhere it is the nearest one that the new triangles can have. No vertex moves.
"""

from __future__ import annotations

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ..state import State
from .plane import angle, cross, metric
from .rebuild import FOLD, rebuilt
from .rest import flat_hinges
from .seams import seams, turned

__all__ = ["flip"]


#: How much the angles opposite to an edge must exceed pi together [radian].
_MARGIN = 0.1
#: How far from pi an angle sum of the triangles alone may be, for that of the hinge to be looked at [radian].
_NEAR = 0.3


def flip(state: State) -> State:
    """Return the state with edges flipped where the rest metric is not Delaunay; itself if there are none."""
    mesh = state.mesh
    some = flat_hinges(state.g, mesh, _NEAR)
    corners = _unfolded(state, some)
    opposite = [angle(corners[:, k], corners[:, 0], corners[:, 1]) for k in (2, 3)]
    excess = opposite[0] + opposite[1] - np.pi
    # both new triangles must be right side up: the quadrangle is convex at the ends of the edge
    p, q, r, s = (corners[:, k] for k in range(4))
    convex = (cross(q - s, r - s) > 0) & (cross(r - s, p - s) > 0)
    now = np.abs(shell.angles(state.x, mesh.hinges[some]))
    even = (now < FOLD) & (np.abs(state.rest[some]) < FOLD) & ~seams(state)[some]
    wanted = np.flatnonzero((excess > _MARGIN) & convex & even)
    if not len(wanted):
        return state
    taken, chosen = np.zeros(len(mesh.triangles), bool), []
    # a flip changes the neighbours' angles: flips of one round share no triangle and no vertex pair
    n, keys, new = mesh.vertices, mesh.edges @ [mesh.vertices, 1], set()
    for at in wanted[np.argsort(-excess[wanted], kind="stable")]:
        hinge = some[at]
        around = mesh.hinge_faces[hinge]
        k, m = sorted(int(v) for v in mesh.hinges[hinge, 2:])
        key = k * n + m
        # keys of edges are sorted
        near = np.searchsorted(keys, key)
        if taken[around].any() or key in new or (near < len(keys) and keys[near] == key):
            continue
        taken[around] = True
        new.add(key)
        chosen.append(at)
    if not chosen:
        return state
    hinges = some[chosen]
    a, b = mesh.hinge_faces[hinges].T
    i, j, k, m = mesh.hinges[hinges].T
    triangles, g = mesh.triangles.copy(), state.g.copy()
    triangles[a], triangles[b] = np.stack([k, m, j], -1), np.stack([m, k, i], -1)
    p, q, r, s = (corners[chosen, c] for c in range(4))
    g[a], g[b] = metric(r, s, q), metric(s, r, p)
    return rebuilt(state, triangles, g, np.arange(len(state.x)), turned(state, hinges), state.faces)


def _unfolded(state: State, some: Ints) -> Floats:
    """Return the corners of some hinges (m,) in the plane of their rest metrics (m, 4, 2); the edge is a mean."""
    mesh, g = state.mesh, state.g
    seen = np.empty((2, len(some), 3))
    for side in range(2):
        # from the start of the edge as each triangle turns, which is the corner after the opposite one
        at = (mesh.hinge_corners[some, side] + 1) % 3
        a, b, c = g[mesh.hinge_faces[some, side]].T
        seen[side] = np.where(
            (at == 0)[:, None],
            np.stack([a, b, c], -1),
            np.where(
                (at == 1)[:, None], np.stack([a + c - 2 * b, a - b, a], -1), np.stack([c, c - b, a + c - 2 * b], -1)
            ),
        )
    length = np.sqrt(0.5 * (seen[0, :, 0] + seen[1, :, 0]))
    corners = np.zeros((len(some), 4, 2))
    corners[:, 1, 0] = length
    for side in range(2):
        own = np.sqrt(seen[side, :, 0])
        along = seen[side, :, 1] / own
        height = np.sqrt(np.maximum(seen[side, :, 2] - along**2, 0.0))
        # the second triangle runs along the edge the other way and lies below
        corners[:, 2 + side, 0] = along * length / own if side == 0 else length - along * length / own
        corners[:, 2 + side, 1] = height if side == 0 else -height
    return corners
