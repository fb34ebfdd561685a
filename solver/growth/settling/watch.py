"""Whether a sheet stays apart from itself, told from what was near when it was last looked at.

Looking all over a sheet takes as long as some steps to its equilibrium. Between two looks nothing has met that was
further apart than it could move: places far from each other along the sheet by what both moved, places near each other
by what the edges in between changed. Only what was nearer is looked at. What is told is the same.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ... import shell
from ...arrays import Bools, Floats, Ints
from ...geometry.crossings import crossings
from ...geometry.unfolded import outline, steepest
from ..state import State
from .energy import vertex_areas
from .minimise import longest
from .touching import lengths_of, near_in, touches

__all__ = ["Watch"]

#: Room for moves over the mean rest edge, at least and at most, and over the longest move that was seen.
_ROOM, _FURTHEST, _AHEAD = 0.1, 0.5, 3.0
#: By which share edges may change in length; as vectors: most, and by which triangles may come nearer each other then,
#: over the mean rest edge. A look pays if one step takes no more of it than a share.
_DRIFT = 0.08
_CHANGE, _NEARER, _PAYS = 0.06, 0.45, 0.5
#: Most looks on the way of one step.
_LOOKS = 16
#: Rest distance along a sheet over the straight one, from which on places feel each other; room for that ways go along
#: edges; and the part of a sheet that its rim may be.
_FELT, _LEAN, _PART = 0.6, 1.1, 0.5
#: Beside rounding.
_SURE = 1 + 1e-9


@dataclass(frozen=True, eq=False)
class _Along:
    """What is near each other along a sheet with edges of such lengths (e,): what may be, and what surely is."""

    lengths: Floats
    near: shell.Near
    surely: shell.Near


@dataclass(frozen=True, eq=False)
class _Close:
    """Pairs (m, 2) of triangles that may cross until edges have changed by a share, as vectors, from x (n, 3) on."""

    x: Floats
    change: float
    pairs: Ints


@dataclass(frozen=True, eq=False)
class _Far:
    """What is far from each other along the sheet and may meet until vertices have moved by the room, from x on."""

    x: Floats
    room: float
    pairs: shell.Pairs


class Watch:
    """Tells of states of one run whether parts pass through each other, or come nearer each other than a distance."""

    def __init__(self, distance: float) -> None:
        self._distance = distance
        self._mesh: shell.Topology | None = None
        #: Vertices along the border in turn, where it is one ring.
        self._rim: Ints | None = None
        self._along: _Along | None = None
        self._close: _Close | None = None
        self._far: _Far | None = None

    @property
    def distance(self) -> float:
        """Return the distance that parts keep from each other once they are near."""
        return self._distance

    def apart(self, start: Floats, end: State) -> Generator[None, None, bool]:
        """Find whether no part of the sheet is as near another as the distance at the end of a straight way.

        Yields after pieces of the work. On the way it is looked whether anything crosses, as often as vertices move by
        an edge. At its start (n, 3) nothing does.
        """
        way = end.x - start
        way -= way.mean(axis=0)
        size, mesh = longest(way), end.mesh
        looks = min(max(int(np.ceil(size / end.length)), 1), _LOOKS)
        self._meet(mesh)
        over = 0.0
        if self._rim is not None:
            over, axes = steepest(end.x - way, end.x, mesh.triangles, self._rim, looks)
            yield
            if over and self._lies_apart(end, over, axes):
                return True
            yield
        if size > _FURTHEST * end.length:
            if not over and (yield from _through(end, way, looks)):
                return False
            known = self._along_still(lengths_of(end))
            if known is None:
                return not touches(end, self._distance, vertex_areas(end))
            # what is near along the sheet outlives a long way, and takes longer to find than all the rest
            return not self._touches(known, self._searched(known, end, 0.0), end)
        along = self._along_now(end)
        yield
        far = self._far_now(along, end, size)
        yield
        close = self._close_now(along, end, way)
        yield
        # what meets on the way was no further apart at its end than both ends moved
        if over:
            through = False
        elif close is None or len(shell.within(end.x, far.pairs, 2 * _SURE * size / self._distance)):
            through = yield from _through(end, way, looks)
        else:
            through = any(shell.any_cross(end.x - k / looks * way, mesh.triangles, close.pairs) for k in range(looks))
        if through:
            return False
        yield
        return not self._touches(along, far, end)

    def clear(self, state: State) -> bool:
        """Return whether nothing of a state crosses."""
        self._meet(state.mesh)
        if self._rim is not None and steepest(state.x, state.x, state.mesh.triangles, self._rim, 1)[0]:
            return True
        return not crossings(state.x, state.mesh.triangles).count

    def _meet(self, mesh: shell.Topology) -> None:
        """Forget what was known of another mesh."""
        if mesh is not self._mesh:
            self._mesh, self._along, self._close, self._far = mesh, None, None, None
            self._rim = outline(mesh.edges[mesh.border])

    def _lies_apart(self, state: State, over: float, axes: Floats) -> bool:
        """Return whether it is sure that no part of a sheet that lies over a plane is as near another as the distance.

        over: least cosine of its slopes. axes (2, 3): of the plane. Straight above what parts two places, the sheet is
        no longer than that over the cosine: so they are near along the sheet, and do not feel each other, unless the
        way leaves the sheet. Then both are as near its rim, which is looked at as a sheet of its own.
        """
        lengths, mesh, rim = lengths_of(state), state.mesh, self._rim
        felt = max(_FELT, self._distance / (self._distance + 2 * float(lengths.max())))
        if rim is None or over < _LEAN * felt:
            return False
        i, j = mesh.edges.T
        edge = float(np.linalg.norm(state.x[i] - state.x[j], axis=1).max())
        flat = state.x @ axes.T
        reach = self._distance + 3 * edge
        away = cKDTree(flat[rim]).query(flat, distance_upper_bound=reach)[0]
        by_rim: Bools = np.asarray(away < reach)
        faces = np.flatnonzero(by_rim[mesh.triangles].any(axis=1))
        if len(faces) > _PART * len(mesh.triangles):
            return False
        part, vertices, _ = shell.part_of(mesh, faces)
        strip = replace(state, x=state.x[vertices], mesh=part, g=state.g[faces])
        return not touches(strip, self._distance, vertex_areas(strip))

    def _along_now(self, state: State) -> _Along:
        """Return what is near along a state's sheet; ways, and the longest that count, change by no more than edges."""
        lengths = lengths_of(state)
        known = self._along_still(lengths)
        if known is None:
            more = _SURE * (1 + _DRIFT) / (1 - _DRIFT)
            near = near_in(state, self._distance, vertex_areas(state), more)
            known = self._along = _Along(lengths, near, near.within(1 / more**2))
            self._close = self._far = None
        return known

    def _along_still(self, lengths: Floats) -> _Along | None:
        """Return what was near along the sheet where it is still, with edges of such lengths (e,)."""
        known = self._along
        changed = known is None or (np.abs(lengths - known.lengths) > _DRIFT * known.lengths).any()
        return None if changed else known

    def _close_now(self, along: _Along, end: State, way: Floats) -> _Close | None:
        """Return what may cross on a way (n, 3) and is near each other along the sheet; None where it is long."""
        known, edges, begin = self._close, end.mesh.edges, end.x - way
        if known:
            change = max(shell.changed(x, known.x, edges, along.lengths) for x in (end.x, begin))
            if change <= known.change:
                return known
        # from any place of one to any of the other: a way that counts, and an edge at either end
        furthest = along.near.limit + 2 * float(along.lengths.max())
        change = min(_CHANGE, _NEARER * end.length / furthest)
        if shell.changed(begin, end.x, edges, along.lengths) > _PAYS * change:
            return None
        pairs = shell.close_faces(end.x, end.mesh.triangles, _SURE * change * furthest)
        self._close = _Close(end.x, change, pairs)
        return self._close

    def _far_now(self, along: _Along, end: State, size: float) -> _Far:
        """Return what may meet on a way of such a size to a state and is far from each other along the sheet."""
        known = self._far
        if known and longest(end.x - known.x) + size <= known.room:
            return known
        room = min(max(_ROOM * end.length, _AHEAD * size), _FURTHEST * end.length)
        known = self._far = self._searched(along, end, room)
        return known

    def _searched(self, along: _Along, end: State, room: float) -> _Far:
        there = end.x, end.mesh, along.surely, self._distance, _SURE * room, 0.0, end.length
        return _Far(end.x, room, shell.search(*there, only="far"))

    def _touches(self, along: _Along, far: _Far, state: State) -> bool:
        """Return what `touches` does: it is asked where the sheet is bent, and where something far is within reach."""
        x, mesh = state.x, state.mesh
        met = shell.within(x, far.pairs)
        ends = shell.owners(far.pairs.stencils[met], far.pairs.kinds[met])
        rows: Bools = ~shell.flat(x, mesh.triangles, along.near.start, along.near.other)
        rows[ends[:, 0]] = True
        if not rows.any():
            return False
        near = near_in(state, self._distance, vertex_areas(state), rows=rows)
        if not near.holds(ends).all():
            return True
        pairs = shell.search(x, mesh, near, self._distance, 0.0, 0.0, state.length, only="near")
        return len(shell.within(x, pairs)) > 0


def _through(end: State, way: Floats, looks: int) -> Generator[None, None, bool]:
    """Look all over whether anything crosses on a way (n, 3) to a state; yields after each look."""
    for k in range(looks):
        if crossings(end.x - k / looks * way, end.mesh.triangles).count:
            return True
        yield
    return False
