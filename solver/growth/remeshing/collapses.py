"""Collapses by the rest metric: short rest edges are removed.

The triangles about the vertex that goes are unfolded into a plane and the new metrics read off. Where the rest state is
flat and neighbours agree on their common edges, that is the same rest state; elsewhere it is the nearest one that the
new triangles can have. No kept vertex moves.
"""

from __future__ import annotations

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ..state import State
from .plane import cross, metric
from .rebuild import FOLD, rebuilt
from .rest import edge_squares
from .seams import seams

__all__ = ["collapse"]


def collapse(state: State, shortest: float) -> tuple[State, Ints]:
    """Return the state without rest edges below `shortest`, and where its vertices (n',) were before.

    Of an edge one vertex goes and the other stays where it is. Borders, held vertices, folds and seams stay.
    """
    mesh = state.mesh
    squares = edge_squares(state.g, mesh)
    short = np.flatnonzero(squares < shortest**2)
    everything = np.arange(len(state.x))
    if not len(short):
        return state, everything
    fixed = np.asarray(state.held.any(axis=1))
    fixed[mesh.edges[mesh.border]] = True
    folded = np.abs(shell.angles(state.x, mesh.hinges)) > FOLD
    fixed[mesh.hinges[folded | seams(state)][:, :2]] = True
    rings = _rings(mesh)
    triangles, g = mesh.triangles.copy(), state.g.copy()
    riding = {name: values.copy() for name, values in state.corners.items()}
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
        for values in riding.values():
            _follow(values, triangles, fan, kept, i, j)
        triangles[fan[kept]] = np.where(triangles[fan[kept]] == i, j, triangles[fan[kept]])
        g[fan[kept]] = metrics
    if not gone.any():
        return state, everything
    left = np.unique(triangles[~gone])
    number = np.full(len(state.x), -1)
    number[left] = np.arange(len(left))
    riding = {name: values[~gone] for name, values in riding.items()}
    faces = {name: values[~gone] for name, values in state.faces.items()}
    return rebuilt(state, number[triangles[~gone]], g[~gone], left, riding, faces), left


def _follow(values: Floats, triangles: Ints, fan: Ints, kept: Ints, i: int, j: int) -> None:
    """Let corners at i, which is on no seam, have the values (f, 3, k) at j as they are seen from there."""
    beside, corner = np.argwhere(triangles[fan] == j)[0]
    rows, at = np.nonzero(triangles[fan[kept]] == i)
    values[fan[kept][rows], at] = values[fan[beside], corner]


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
    area = cross(q - p, r - p)
    longest = np.max([((u - v) ** 2).sum(-1) for u, v in ((p, q), (q, r), (r, p))], axis=0)
    if (area < 0.3 * longest).any():
        return None
    return kept, metric(p, q, r)


def _turned(g: Floats, at: int) -> tuple[float, float, float]:
    """Return the metric as seen from another corner."""
    a, b, c = (float(v) for v in g)
    if at == 0:
        return a, b, c
    if at == 1:
        return a + c - 2 * b, a - b, a
    return c, c - b, a + c - 2 * b
