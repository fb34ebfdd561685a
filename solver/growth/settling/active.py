"""Equilibrium by need: first of the part whose rest state changed, the rest held; then the whole is looked at.

Where the forces of the whole are below the goal after the part has settled, nothing else need move, and nothing else
does, to the last bit. Where they are not, the whole is solved, and the part waits for some steps, longer each time.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ... import shell
from ...arrays import Bools, Floats, Ints
from ..state import State
from .energy import StepEnergy, ahead
from .minimise import Point, longest
from .tangent import Tangent

__all__ = ["Habit", "Settled", "settle"]

Way = Callable[[StepEnergy, Floats], Iterator[Point]]

#: Rings about what changed that move with it, and the share of the vertices beyond which the whole is no more work.
_RINGS, _LARGEST = 4, 0.4
#: How far below the goal the part comes to rest, and its steps until then.
_BELOW, _STEPS = 0.7, 6
#: Steps of growth without a part after parts did not do, once, twice, and so on.
_PAUSES = (0, 3, 15, 63)


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a mesh with all that acts on its free vertices.

    vertices (m,), faces, hinges: numbers in the whole, rising. free: (m,) those that may move.
    """

    vertices: Ints
    faces: Ints
    hinges: Ints
    free: Bools
    tangent: Tangent

    def inside(self, count: int) -> Bools:
        """Return which of the whole's vertices (count,) are free."""
        found = np.zeros(count, bool)
        found[self.vertices[self.free]] = True
        return found

    def of(self, state: State) -> State:
        """Return the part of a state, held where it is not free."""
        v = self.vertices
        return replace(
            state,
            x=state.x[v],
            mesh=self.tangent.mesh,
            g=state.g[self.faces],
            rest=state.rest[self.hinges],
            held=state.held[v] | ~self.free[:, None],
            drift=None if state.drift is None else state.drift[v] * self.free[:, None],
            matter={k: values[v] for k, values in state.matter.items()},
            loose=None if state.loose is None else state.loose[self.faces],
            shares={},
            spots={},
            curves={},
        )

    def copy(self) -> Part:
        """Return a part whose tangent may take another inverse."""
        return replace(self, tangent=self.tangent.copy())

    def remeshed(self, mesh: shell.Topology, changes: list[Ints]) -> Part:
        """Return the part of a mesh that came from this one's by changes (`remesh`), with its inverse."""
        vertices, free, inverse = self.vertices, self.free, self.tangent.inverse
        for pairs in changes:
            number = np.full(int(max(pairs.max(), vertices.max())) + 1, -1)
            number[vertices] = np.arange(len(vertices))
            local = number[pairs]
            kept = np.flatnonzero((local >= 0).all(axis=1))
            inverse = inverse.remeshed(local[kept]) if inverse else None
            vertices, free = kept, free[local[kept]].all(axis=1)
        moving = np.zeros(mesh.vertices, bool)
        moving[vertices[free]] = True
        found = _part(mesh, moving)
        # vertices that the part did not have are held: what the inverse has for them is not asked for
        number = np.zeros(mesh.vertices, np.int64)
        number[vertices] = np.arange(len(vertices))
        here = number[found.vertices]
        if inverse is not None and not np.array_equal(here, np.arange(len(vertices))):
            inverse = Tangent(mesh, inverse).remeshed(mesh, np.stack([here, here], -1)).inverse
        return replace(found, tangent=Tangent(found.tangent.mesh, inverse))


@dataclass(frozen=True, eq=False)
class Habit:
    """What the search keeps between steps.

    part: the last one. failures: how often in a row parts did not do. wait: steps until the next try. seen: vertices
    (n,) that changed in the last step and had no part: one is taken where the same change again, for it must pay.
    """

    part: Part | None = None
    failures: int = 0
    wait: int = 0
    seen: Bools | None = None

    def copy(self) -> Habit:
        """Return a habit whose part may take another inverse."""
        return replace(self, part=self.part.copy() if self.part else None)

    def remeshed(self, mesh: shell.Topology, changes: list[Ints]) -> Habit:
        """Return the habit on a mesh that came from the present one by changes."""
        seen = self.seen
        for pairs in changes:
            seen = None if seen is None else np.asarray(seen[pairs].any(axis=1))
        return replace(self, part=self.part.remeshed(mesh, changes) if self.part else None, seen=seen)


@dataclass(frozen=True, eq=False)
class Settled:
    """Where the search for the whole begins, the steps taken, what is kept for the next."""

    x: Floats
    spent: int
    habit: Habit


def settle(
    energy: StepEnergy, changed: Bools, goal: float, dt: float, habit: Habit, way: Way
) -> Generator[None, None, Settled]:
    """Let the part about `changed` triangles (f,) settle to the goal; yields after every piece of work.

    The generator's value is where the whole is then: in equilibrium, or nearer to it.
    """
    state, n = energy.state, energy.state.mesh.vertices
    if habit.wait:
        return Settled(ahead(energy, state, dt), 0, replace(habit, wait=habit.wait - 1))
    moving = np.zeros(n, bool)
    moving[state.mesh.triangles[changed]] = True
    x, spent, part = state.x, 0, habit.part
    if moving.any():
        if part is None or (_wider(state.mesh, moving, 1) & ~part.inside(n)).any():
            again = habit.seen is not None and not (moving & ~_wider(state.mesh, habit.seen, 1)).any()
            free = _wider(state.mesh, moving, _RINGS)
            if not again or free.sum() > _LARGEST * n:
                return Settled(ahead(energy, state, dt), 0, replace(habit, seen=moving))
            part = _part(state.mesh, free)
        yield
        own = part.of(state)
        smaller = energy.part(own, part.tangent)
        point = Point(own.x, 0.0, np.inf)
        for nearer in way(smaller, ahead(smaller, own, dt)):
            spent += nearer.x is not point.x
            point = nearer
            if point.gradient <= _BELOW * goal or point.stuck or spent > _STEPS or not np.isfinite(point.gradient):
                break
            yield
        if np.isfinite(point.gradient):
            x = state.x.copy()
            x[part.vertices[part.free]] = point.x[part.free]
        yield
    value, forces = energy(x)
    if longest(forces) <= goal:
        return Settled(x, max(spent - 1, 0), Habit(part))
    yield
    further = ahead(energy, state, dt)
    x = further if energy(further)[0] < value else x
    failures = habit.failures + 1
    return Settled(x, spent, Habit(part, failures, _PAUSES[min(failures, len(_PAUSES)) - 1]))


def _wider(mesh: shell.Topology, some: Bools, rings: int) -> Bools:
    for _ in range(rings):
        found = np.zeros(mesh.vertices, bool)
        found[mesh.triangles[_touched(mesh, some)]] = True
        some = found
    return some


def _touched(mesh: shell.Topology, some: Bools) -> Bools:
    """Return which triangles (f,) have a corner among some vertices (n,)."""
    i, j, k = mesh.triangles.T
    found: Bools = some[i] | some[j] | some[k]
    return found


def _part(mesh: shell.Topology, moving: Bools) -> Part:
    """Return the part whose free vertices are `moving` (n,)."""
    # a vertex feels the hinges of its neighbours' edges (and, with mean curvature, all hinges of its neighbours)
    faces = np.flatnonzero(_touched(mesh, _wider(mesh, moving, 1)))
    smaller, vertices, hinges = shell.part_of(mesh, faces)
    return Part(vertices, faces, hinges, moving[vertices], Tangent(smaller))
