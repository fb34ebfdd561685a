"""Flips and collapses by the rest metric: long thin rest triangles are turned over, short rest edges removed.

Both unfold the triangles concerned into the plane of their rest metrics, take them apart there in another way, and read
the new metrics off. Where the rest state is flat and neighbours agree on their common edges, that is the same rest
state; elsewhere it is the nearest one that the new triangles can have. No kept
vertex moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .. import shell
from .rest import edge_squares, flat_hinges
from .state import Anchors, State, corners_of, on_surface

__all__ = ["collapse", "flip"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How much the angles opposite to an edge must exceed pi together, and the fold beyond which an edge stays [radian].
_MARGIN, _FOLD = 0.1, 0.5
#: How far from pi an angle sum of the triangles alone may be, for that of the hinge to be looked at [radian].
_NEAR = 0.3


def flip(state: State) -> State:
    """Return the state with edges flipped where the rest metric is not Delaunay; itself if there are none."""
    mesh = state.mesh
    some = flat_hinges(state.g, mesh, _NEAR)
    corners = _unfolded(state, some)
    angle = [_angle(corners[:, k], corners[:, 0], corners[:, 1]) for k in (2, 3)]
    excess = angle[0] + angle[1] - np.pi
    # both new triangles must be right side up: the quadrangle is convex at the ends of the edge
    p, q, r, s = (corners[:, k] for k in range(4))
    convex = (_cross(q - s, r - s) > 0) & (_cross(r - s, p - s) > 0)
    now = np.abs(shell.angles(state.x, mesh.hinges[some]))
    wanted = np.flatnonzero((excess > _MARGIN) & convex & (now < _FOLD) & (np.abs(state.rest[some]) < _FOLD))
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
    g[a], g[b] = _metric(r, s, q), _metric(s, r, p)
    return _rebuilt(state, triangles, g, np.arange(len(state.x)))


def collapse(state: State, shortest: float) -> tuple[State, Ints]:
    """Return the state without rest edges below `shortest`, and where its vertices (n',) were before.

    Of an edge one vertex goes and the other stays where it is. Borders, held vertices and folds stay.
    """
    mesh = state.mesh
    squares = edge_squares(state.g, mesh)
    short = np.flatnonzero(squares < shortest**2)
    everything = np.arange(len(state.x))
    if not len(short):
        return state, everything
    fixed = np.asarray(state.held.any(axis=1))
    fixed[mesh.edges[mesh.border]] = True
    folded = np.abs(shell.angles(state.x, mesh.hinges)) > _FOLD
    fixed[mesh.hinges[folded][:, :2]] = True
    rings = _rings(mesh)
    triangles, g = mesh.triangles.copy(), state.g.copy()
    taken, gone = np.zeros(len(state.x), bool), np.zeros(len(triangles), bool)
    for edge in short[np.argsort(squares[short], kind="stable")]:
        i, j = (int(v) for v in mesh.edges[edge])
        if fixed[i]:
            i, j = j, i
        if fixed[i]:
            continue
        fan, around = rings[i], np.unique(mesh.triangles[rings[i]])
        beyond = np.unique(mesh.triangles[rings[j]])
        # the ends must share two neighbours, else sheets would meet
        if taken[around].any() or len(np.intersect1d(around, beyond)) != 4 or len(fan) < 4:
            continue
        found = _without(mesh.triangles[fan], state.g[fan], i, j)
        if found is None:
            continue
        taken[around] = True
        kept, metrics = found
        gone[fan] = True
        gone[fan[kept]] = False
        triangles[fan[kept]] = np.where(triangles[fan[kept]] == i, j, triangles[fan[kept]])
        g[fan[kept]] = metrics
    if not gone.any():
        return state, everything
    left = np.unique(triangles[~gone])
    number = np.full(len(state.x), -1)
    number[left] = np.arange(len(left))
    return _rebuilt(state, number[triangles[~gone]], g[~gone], left), left


def _rings(mesh: shell.Topology) -> list[Ints]:
    """Return the triangles about each vertex."""
    order = np.argsort(mesh.triangles.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(mesh.triangles.ravel(), minlength=mesh.vertices))
    return np.split(order // 3, ends[:-1])


def _without(fan: Ints, g: Floats, i: int, j: int) -> tuple[Ints, Floats] | None:
    """Return which triangles of a fan about i stay when i goes to j, and their metrics; None if one would turn over."""
    after: dict[int, tuple[int, float, float, float]] = {}
    for t, triangle in enumerate(fan):
        at = int(np.flatnonzero(triangle == i)[0])
        (a, b, c) = _turned(g[t], at)
        after[int(triangle[(at + 1) % 3])] = (int(triangle[(at + 2) % 3]), a, b, c)
    # the fan is laid out about i, its angles scaled to a full turn
    names, turns = [j], [0.0]
    spans: list[float] = []
    sizes: dict[int, list[float]] = {}
    while len(spans) < len(fan):
        here = names[-1]
        if here not in after:
            return None
        following, a, b, c = after[here]
        spans.append(float(np.arccos(np.clip(b / np.sqrt(a * c), -1, 1))))
        sizes.setdefault(here, []).append(np.sqrt(a))
        sizes.setdefault(following, []).append(np.sqrt(c))
        turns.append(turns[-1] + spans[-1])
        names.append(following)
    if names[-1] != j or abs(turns[-1] - 2 * np.pi) > 0.5:
        return None
    place = {
        name: np.mean(sizes[name]) * np.array([np.cos(turn), np.sin(turn)])
        for name, turn in zip(names, np.array(turns[:-1]) * 2 * np.pi / turns[-1], strict=False)
    }
    place[i] = place[j]
    kept = np.flatnonzero(~(fan == j).any(axis=1))
    points = np.array([[place[int(v)] for v in fan[t]] for t in kept])
    p, q, r = points[:, 0], points[:, 1], points[:, 2]
    area = _cross(q - p, r - p)
    longest = np.max([((u - v) ** 2).sum(-1) for u, v in ((p, q), (q, r), (r, p))], axis=0)
    if (area < 0.3 * longest).any():
        return None
    return kept, _metric(p, q, r)


def _turned(g: Floats, at: int) -> tuple[float, float, float]:
    """Return the metric as seen from another corner."""
    a, b, c = (float(v) for v in g)
    if at == 0:
        return a, b, c
    if at == 1:
        return a + c - 2 * b, a - b, a
    return c, c - b, a + c - 2 * b


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


def _cross(u: Floats, v: Floats) -> Floats:
    found: Floats = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return found


def _angle(at: Floats, p: Floats, q: Floats) -> Floats:
    u, v = p - at, q - at
    return np.abs(np.arctan2(_cross(u, v), (u * v).sum(-1)))


def _metric(p: Floats, q: Floats, r: Floats) -> Floats:
    u, v = q - p, r - p
    return np.stack([(u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)], -1)


def _widths(g: Floats, mesh: shell.Topology) -> Floats:
    """Return the sum of both triangles' heights over each hinge's edge (h,)."""
    squares = np.stack([g[:, 0] + g[:, 2] - 2 * g[:, 1], g[:, 2], g[:, 0]], -1)
    heights = 2 * shell.areas(g)[:, None] / np.sqrt(squares)
    found: Floats = heights[mesh.hinge_faces, mesh.hinge_corners].sum(axis=1)
    return found


def _rebuilt(state: State, triangles: Ints, g: Floats, left: Ints) -> State:
    """Return the state on new triangles; left (n',): vertices that stay.

    Hinges that were there keep their rest angles; new ones are bent like the old ones about their ends.
    """
    mesh, n = state.mesh, len(state.x)
    new = shell.topology(triangles, len(left))
    bent = state.rest / _widths(state.g, mesh)
    total = np.bincount(mesh.hinges.ravel(), np.repeat(bent, 4), n) / np.maximum(
        np.bincount(mesh.hinges.ravel(), minlength=n), 1
    )
    rest = total[left][new.hinges[:, :2]].mean(axis=1) * _widths(g, new)
    before, now = mesh.edges[mesh.hinge_edges] @ [n, 1], left[new.edges[new.hinge_edges]] @ [n, 1]
    _, old, same = np.intersect1d(before, now, return_indices=True)
    rest[same] = state.rest[old]
    x = state.x[left]
    corners = corners_of(x, triangles)

    def moved(anchors: Anchors) -> Anchors:
        return on_surface(anchors, state.x, mesh.triangles, corners)

    return replace(
        state,
        x=x,
        mesh=new,
        g=g,
        rest=rest,
        shares={k: v[left] for k, v in state.shares.items()},
        held=state.held[left],
        drift=None if state.drift is None else state.drift[left],
        spots={k: tuple(replace(spot, anchor=moved(spot.anchor)) for spot in v) for k, v in state.spots.items()},
        curves={k: moved(a) for k, a in state.curves.items()},
    )
