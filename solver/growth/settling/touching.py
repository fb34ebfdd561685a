"""A sheet that does not pass through itself: what may touch, how it pushes, and how far a step may go.

What lies further apart than the room for moves is not looked at, until something has moved that far.
"""

from __future__ import annotations

import numpy as np

from ... import shell
from ...arrays import Bools, Floats, Ints
from ...linalg.multifrontal import Analysis, analyse
from ...linalg.patterns import distinct
from ...shell.contact.steps import largest
from ..state import State

__all__ = ["Touching", "lengths_of", "near_in", "touches"]

#: Room for moves, at first and at most, and for the change of an edge, over the mean rest edge.
_FAR, _FURTHEST, _CHANGE = 0.2, 1.0, 0.12
#: Share of a step up to a touch that is taken.
_SHORT = 0.9
#: How much further than their reach stencils are apart that are coupled in second derivatives already.
_AHEAD = 1.3


class Touching:
    """Contact of a state's sheet with itself, as its energy sees it."""

    def __init__(self, state: State, distance: float, unit: float, areas: Floats) -> None:
        """distance: that parts keep. unit: force that bends an edge [mu l]. areas (n,): of the vertices at rest."""
        self._mesh, self._length, self._distance = state.mesh, _edge(state), distance
        self._near = near_in(state, distance, areas)
        # pressure that bends a sheet as sharply as its mesh can show
        self._hardness = unit / state.length**2
        self._coupled: tuple[Ints, shell.Pattern, Analysis] | None = None
        #: What was close where it was last asked for, and what `coupled` made of it.
        self._asked: tuple[Floats, Ints, tuple[shell.Pattern, Analysis] | None] | None = None
        self.look(state.x, _FAR)

    def look(self, x: Floats, room: float = _FAR) -> None:
        """Find what may touch from x (n, 3) on; room: of moves, over the mean rest edge."""
        self._seen, self._room, self._asked = x, room * self._length, None
        change = _CHANGE * self._length
        self.pairs = shell.search(x, self._mesh, self._near, self._distance, self._room, change, self._length)
        self._stiffness = self._hardness * self.pairs.areas

    def energy(self, x: Floats, gradient: Floats) -> float:
        """Return the energy at x (n, 3) and add its gradient."""
        move, change = largest(x - self._seen, self._mesh.edges)
        if move > 1.001 * self._room or change > 1.001 * _CHANGE * self._length:
            self.look(x)
            move = change = 0.0
        energy = 0.0
        for part in self._parts(move, change):
            p = self.pairs
            energy += shell.barrier(x, p.stencils[part], p.kinds[part], p.reach[part], self._stiffness[part], gradient)
        return energy

    def allowed(self, x: Floats, way: Floats, wanted: float) -> float:
        """Return how much of `way` (n, 3), at most `wanted`, may be gone from x (n, 3) without touching."""
        edges, length = self._mesh.edges, self._length
        speed, change = largest(way, edges)
        if speed == 0.0:
            return wanted
        moved, changed = largest(x - self._seen, edges)
        free = self._free(moved, changed, speed, change)
        if free < wanted and moved > 0:
            self.look(x, min(max(_FAR, wanted * speed / length), _FURTHEST))
            moved = changed = 0.0
            free = self._free(moved, changed, speed, change)
        until = wanted = min(wanted, free)
        for part in self._parts(moved + wanted * speed, changed + wanted * change):
            until = shell.free_step(x, way, self.pairs.stencils[part], self.pairs.kinds[part], until)
        return wanted if until >= wanted else _SHORT * until

    def _parts(self, move: float, change: float) -> tuple[slice, slice]:
        """Return what may have come within reach since the last look, when vertices moved and edges changed so far."""
        near, far = self.pairs.within(change, move)
        return slice(0, near), slice(self.pairs.near, self.pairs.near + far)

    def _free(self, moved: float, changed: float, speed: float, change: float) -> float:
        """Return how far a way may go before what was found may not be all."""
        left = (self._room - moved) / speed, (_CHANGE * self._length - changed) / max(change, 1e-300)
        return max(min(left), 0.0)

    def add_diagonal(self, x: Floats, diagonal: Ints, blocks: Floats) -> None:
        """Add the stiffness along the gaps at each vertex to the diagonal of `blocks` (nnz, 3, 3)."""
        p = self.pairs
        shell.barrier_diagonal(x, p.stencils, p.kinds, p.reach, self._stiffness, diagonal, blocks)

    def coupled(self, x: Floats, leaf: int) -> tuple[shell.Pattern, Analysis] | None:
        """Return pattern and order of elimination where what touches is coupled; None where nothing does."""
        if self._asked is None or self._asked[0] is not x:
            close = shell.within(x, self.pairs, _AHEAD)
            self._asked = x, close, self._order(x, close, leaf) if len(close) else None
        return self._asked[2]

    def _order(self, x: Floats, close: Ints, leaf: int) -> tuple[shell.Pattern, Analysis]:
        """Return pattern and order of elimination that couple these stencils, the last ones where they do."""
        pairs = _couples(self.pairs.stencils[close], self._mesh.vertices)
        if self._coupled is None or not np.isin(pairs, self._coupled[0]).all():
            n = self._mesh.vertices
            both = np.concatenate([self._mesh.edges, self._mesh.hinges[:, 2:], np.stack([pairs // n, pairs % n], -1)])
            pattern = shell.pattern(self._mesh, both[-len(pairs) :])
            order = analyse(both, x[both].mean(axis=1), pattern.indptr, pattern.indices, leaf_size=leaf)
            self._coupled = pairs, pattern, order
        return self._coupled[1:]

    def add_hessian(self, x: Floats, pattern: shell.Pattern, blocks: Floats) -> None:
        """Add the second derivative to `blocks` (nnz, 3, 3) of a pattern from `coupled`."""
        near = shell.within(x, self.pairs)
        p = self.pairs
        where = pattern.of(p.stencils[near])
        rest = p.reach[near], self._stiffness[near], where
        shell.barrier_hessian(x, p.stencils[near], p.kinds[near], *rest, blocks)


def touches(state: State, distance: float, areas: Floats) -> bool:
    """Return whether anything of a state is within reach as `Touching` has it."""
    near = near_in(state, distance, areas)
    found = shell.search(state.x, state.mesh, near, distance, 0.0, 0.0, state.length)
    return len(shell.within(state.x, found)) > 0


def near_in(state: State, distance: float, areas: Floats, share: float = 1.0, rows: Bools | None = None) -> shell.Near:
    """Return what is near each other along a state's sheet; see `shell.near_of`."""
    # where a step grows threefold what is near is near as it is, too: else it would push before it has room
    metrics = state.g, shell.metric(state.x, state.mesh.triangles)
    return shell.near_of(metrics, state.mesh, lengths_of(state), areas, distance, share, rows)


def lengths_of(state: State) -> Floats:
    """Return the lengths of edges (e,) at rest or as they are, the lesser."""
    now = shell.metric(state.x, state.mesh.triangles)
    found: Floats = np.minimum(_lengths(state.g, state.mesh), _lengths(now, state.mesh))
    return found


def _lengths(g: Floats, mesh: shell.Topology) -> Floats:
    """Return the lengths of edges (e,) by metrics (f, 3), the longest where triangles differ."""
    found = np.zeros(len(mesh.edges))
    squares = np.stack([g[:, 0] + g[:, 2] - 2 * g[:, 1], g[:, 2], g[:, 0]], -1)
    np.maximum.at(found, mesh.face_edges.ravel(), squares.ravel())
    return np.sqrt(found)


def _edge(state: State) -> float:
    """Return the mean edge at rest or as it is, the lesser."""
    i, j = state.mesh.edges.T
    return min(state.length, float(np.linalg.norm(state.x[i] - state.x[j], axis=1).mean()))


def _couples(stencils: Ints, n: int) -> Ints:
    """Return the pairs of vertices of stencils (m, 4) as sorted keys i n + j, i < j."""
    pairs = np.concatenate([stencils[:, [a, b]] for a in range(4) for b in range(a + 1, 4)])
    return distinct(pairs.min(axis=1) * n + pairs.max(axis=1))
