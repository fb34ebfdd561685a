"""A patch of a bundle: some vertices free, everything about them held, as a bundle of its own.

What breaks disturbs its surroundings first, and the end of a splinter swings alone. Kernels run on a patch as they do
on the whole, at the cost of the patch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import Bonds, Rods
from .explicit import Motion
from .moment import State
from .state import Wood, scratch_for

__all__ = ["Patch", "cut_out", "disturbed", "surrounded"]


@dataclass(frozen=True, eq=False)
class Patch:
    """A state of its own, and where its vertices are: free (n,) of the whole, `own` (n,) the same in the patch."""

    state: State
    vertices: np.ndarray
    """(v,) of the whole"""
    free: np.ndarray
    own: np.ndarray


def disturbed(r: np.ndarray, left: float, most: int) -> np.ndarray | None:
    """Return the vertices without which the residual r (v, 3) has the norm `left`; None: more than `most`."""
    square = np.einsum("vi,vi->v", r, r)
    top = np.argpartition(square, -most)[-most:] if most < len(square) else np.arange(len(square))
    rest = float(square.sum() - square[top].sum())
    if rest > left * left:
        return None
    order = top[np.argsort(square[top], kind="stable")]
    keep = np.searchsorted(np.cumsum(square[order]) + rest, left * left, side="right")
    return np.asarray(order[keep:])


def _parts(wood: Wood) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vertices of edges (e, 2), hinges (h, 3) and bonds (b, 3); -1 for those that are no more."""
    rods, bonds = wood.rods, wood.bonds
    edge = np.stack([rods.a, rods.b], 1)
    hinge = np.stack([rods.a[rods.before], rods.b[rods.before], rods.b[rods.after]], 1)
    bond = np.stack([bonds.i, rods.a[bonds.j], rods.b[bonds.j]], 1)
    return edge, np.where(rods.whole[:, None] == 1, hinge, -1), np.where(bonds.on[:, None] == 1, bond, -1)


def surrounded(wood: Wood, core: np.ndarray, rings: int, most: int) -> np.ndarray | None:
    """Return a mask (v,) of `core` and what is up to `rings` elements away; None if that is more than `most`."""
    count = len(wood.motion.x)
    # the last entry stands for what is no more
    inside = np.zeros(count + 1, bool)
    inside[core] = True
    edge, hinge, bond = _parts(wood)
    edge = np.where((wood.rods.alive[:, None] == 1) & (wood.rods.k[:, None] > 0), edge, -1)
    for _ in range(rings):
        last = inside.copy()
        for part in (edge, hinge, bond):
            inside[part[last[part].any(1)]] = True
        inside[-1] = False
    inside[:-1] &= wood.motion.held == 0
    found = inside[:-1]
    return found if 0 < found.sum() <= most else None


def _points(first: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the contact points of `edges` begin among their own (n + 1,), and their numbers in the whole."""
    count = first[edges + 1] - first[edges]
    begin = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    return begin, np.arange(begin[-1]) + np.repeat(first[edges] - begin[:-1], count)


def cut_out(state: State, inside: np.ndarray) -> Patch:
    """Return the elements that touch the vertices `inside` (v,) bool, with copies of their state."""
    wood = state.wood
    m, rods, bonds, bodies = wood.motion, wood.rods, wood.bonds, wood.bodies
    edge, hinge, bond = _parts(wood)
    mask = np.append(inside, False)
    hinges = np.flatnonzero(mask[hinge].any(1))
    kept = np.flatnonzero(mask[bond].any(1))
    needed = mask[edge].any(1)
    needed[rods.before[hinges]] = True
    needed[rods.after[hinges]] = True
    needed[bonds.j[kept]] = True
    edges = np.flatnonzero(needed)
    used = np.zeros(len(m.x), bool)
    used[edge[edges]] = True
    used[bonds.i[kept]] = True
    used |= inside
    vertices = np.flatnonzero(used)
    of = np.full(len(m.x), -1, np.int32)
    of[vertices] = np.arange(len(vertices), dtype=np.int32)
    of_edge = np.full(len(rods.a), -1, np.int32)
    of_edge[edges] = np.arange(len(edges), dtype=np.int32)
    own = {"a": of[rods.a[edges]], "b": of[rods.b[edges]]}
    turn = {"before": of_edge[rods.before[hinges]], "after": of_edge[rods.after[hinges]]}
    at_edge, at_hinge = ("rest", "k", "alive", "radius"), ("span", "alpha", "whole")
    some = Rods(
        **own,
        **turn,
        **{name: getattr(rods, name)[edges] for name in at_edge},
        **{name: getattr(rods, name)[hinges] for name in at_hinge},
    )
    ties = Bonds(*(getattr(bonds, name)[kept] for name in Bonds._fields))._replace(
        i=of[bonds.i[kept]], j=of_edge[bonds.j[kept]]
    )
    first, numbers = _points(bodies.first, edges)
    held = np.where(inside, m.held, np.uint8(1))[vertices]
    at_vertex = {"x": m.x, "v": m.v, "mass": m.mass, "load": m.load}
    along = {"d": m.d, "old": m.old, "theta": m.theta, "spin": m.spin}
    motion = Motion(
        **{name: a[vertices] for name, a in at_vertex.items()},
        held=held,
        **{name: a[edges] for name, a in along.items()},
        reference=m.reference[hinges],
    )
    small = replace(
        wood,
        motion=motion,
        rods=some,
        bonds=ties,
        bodies=bodies._replace(first=first),
        turns=wood.turns._replace(inertia=wood.turns.inertia[edges]),
        strength=wood.strength[edges],
        parent=np.arange(len(vertices), dtype=np.int32),
    )
    scratch = scratch_for(small)
    if len(bodies.kind):
        scratch.lagged[:] = state.scratch.lagged[:, numbers]
    part = state._replace(wood=small, scratch=scratch, books=np.zeros(6), impulse=np.zeros_like(state.impulse))
    free = np.flatnonzero(inside)
    return Patch(part, vertices, free, of[free])
