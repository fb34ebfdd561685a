"""Hewing: of wood whose fibres run out of the bundle, what lies outside is taken away, and rods end where they run out.

They run out over some length, as the surface cuts them obliquely: each edge has as much of its section as lies within.
What is left of an edge that the surface passes is a stub, which the edge beside it carries, as beside a break. Edges
outside count as ghosts: they have no stiffness, and their vertices rest. So rods keep their numbers of vertices.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..fracture import sever
from ..model.gripping import courses, pins_of
from ..model.joining import stretched
from ..model.outline import corners, covered, facing
from ..model.state import Wood
from ..params import WoodParams
from ..shape.taper import thickness
from .timber import LEAST, hews

__all__ = ["hewn"]

#: Rods of no more vertices, or of fewer bonds, are chips; rounds in which what hung on chips goes with them.
_VERTICES, _BONDS, _ROUNDS = 2, 6, 8


def _even(wood: Wood, params: WoodParams) -> np.ndarray:
    """Return where vertices (v, 2) [m] are in the section, as if it did not taper."""
    found: np.ndarray = wood.straight[:, 1:] / thickness(wood.straight[:, 0], params)[:, None]
    return found


def _left(wood: Wood, outline: np.ndarray, section: np.ndarray) -> np.ndarray:
    """Return the share (v,) of their rods' sections that is within the outline where vertices are in the section."""
    count = section.shape[0] // len(wood.grid)
    cell = np.sqrt(np.pi) * wood.rods.radius.reshape(len(wood.grid), -1).mean(1)
    return covered(outline, section, np.repeat(cell, count))


def _passes(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return where (n,) rods end between vertices of which the shares first (n,) and second (n,) are left."""
    found: np.ndarray = np.clip((first - LEAST) / np.maximum(first - second, 1e-300), 0.0, 1.0)
    return found


def _kept(wood: Wood, share: np.ndarray) -> np.ndarray:
    """Return which vertices (v,) are left: those within, but for chips that next to nothing holds, which would dangle.

    Ghosts count with the rods that they clamp. share (v,): of sections that is left.
    """
    rods, bonds = wood.rods, wood.bonds
    within = (share > LEAST).reshape(len(wood.grid), -1)
    for _ in range(_ROUNDS):
        starts = within & ~np.column_stack([np.zeros(len(within), bool), within[:, :-1]])
        run = np.cumsum(starts.ravel()).reshape(within.shape) * within
        of, kept = run.ravel(), within.ravel()
        size = np.bincount(of)
        whole = kept[rods.a] & kept[rods.b]
        joined = whole[bonds.i] & whole[bonds.j] & (bonds.on > 0)
        held = np.bincount(of[rods.a[bonds.i[joined]]], minlength=len(size))
        held += np.bincount(of[rods.a[bonds.j[joined]]], minlength=len(size))
        few = (size <= _VERTICES) | (held < (_BONDS if len(bonds.i) else 0))
        if not (few[of] & kept).any():
            break
        within &= ~few[run]
    found: np.ndarray = within.ravel()
    return found


def hewn(wood: Wood, params: WoodParams) -> Wood:
    """Return the bundle as laid without what lies outside of its outline; chips are taken away."""
    if not hews(params):
        return wood
    rods, bonds = wood.rods, wood.bonds
    outline, section = corners(params), _even(wood, params)
    share = _left(wood, outline, section)
    within = _kept(wood, share)
    a, b = within[rods.a], within[rods.b]
    before, slope = stretched(wood.motion.x, rods, bonds)
    out = np.flatnonzero(~a & ~b)
    rods.alive[out] = 0
    rods.whole[np.isin(rods.before, out) | np.isin(rods.after, out)] = 0
    cut = np.where(a & b, 2.0, np.nan)
    leaves = np.flatnonzero((a != b) & (rods.k > 0))
    ends = np.where(a[leaves], rods.a[leaves], rods.b[leaves]), np.where(a[leaves], rods.b[leaves], rods.a[leaves])
    way = _passes(share[ends[0]], share[ends[1]])
    cut[leaves] = np.where(a[leaves], way, 1 - way)
    for edge, at in ((bonds.i, bonds.at), (bonds.j, bonds.share)):
        # what sits beyond the surface goes with it
        bonds.on[~np.where(a[edge], at < cut[edge], at > cut[edge])] = 0
    _thinned(wood, np.maximum((share[rods.a] + share[rods.b]) / 2, LEAST), outline, section)
    for e in leaves.tolist():
        sever(wood, e, float(cut[e]))
    rods.k[rods.alive == 0] = 0.0
    bonds.on[(rods.alive[bonds.i] == 0) | (rods.alive[bonds.j] == 0)] = 0
    _laid_again(wood, before, slope)
    left = np.where(rods.alive == 1, np.where(rods.k > 0, 1.0, 0.0), 0.0)
    left[leaves] = way
    return _weighed(wood, params, left, a)


def _thinned(wood: Wood, share: np.ndarray, outline: np.ndarray, section: np.ndarray) -> None:
    """Leave edges, hinges and bonds the share (e,) of their edges' sections; section (v, 2): where vertices are."""
    rods, bonds, turns = wood.rods, wood.bonds, wood.turns
    rods.k[:] *= share
    rods.radius[:] *= np.sqrt(share)
    bent = (share[rods.before] + share[rods.after]) ** 2 / 4
    rods.alpha[:] *= bent
    turns.beta[:] *= bent
    turns.inertia[:] *= share**2
    faces, between = _joined(wood, share, outline, section)
    for values in (bonds.torn, bonds.shorn, bonds.area):
        values[:] *= faces
    for values in (bonds.k, bonds.s, bonds.opens, bonds.slides):
        values[:] *= faces * between


def _joined(wood: Wood, share: np.ndarray, outline: np.ndarray, section: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what is left of the faces (b,) by which rods are joined, and of the wood between their middles (b,).

    share (e,), section (v, 2): as in `_thinned`. A surface that cuts off the back of a rod leaves the face with what
    lies before it whole, down to the end; of the faces with rods beside it, as much is left as of the rods.
    """
    rods, bonds = wood.rods, wood.bonds
    one, other = ((section[rods.a[e]] + section[rods.b[e]]) / 2 for e in (bonds.i, bonds.j))
    normal, way = facing(outline, (one + other) / 2), other - one
    square = np.maximum((way**2).sum(1), 1e-300)
    inward = (way * normal).sum(1) ** 2 / square
    i, j = share[bonds.i], share[bonds.j]
    return inward + (1 - inward) * np.sqrt(i * j), (i + j) / (2 * np.maximum(i, j))


def _laid_again(wood: Wood, before: np.ndarray, slope: np.ndarray) -> None:
    """Lay bonds on the curves that are left, as beside a break, so that they are at rest."""
    bonds = wood.bonds
    later, lean = stretched(wood.motion.x, wood.rods, bonds)
    on = bonds.on > 0
    longer = np.where(on, later / np.maximum(before, 1e-300), 1.0)
    bonds.rest[:] *= longer
    bonds.k[:] /= longer
    bonds.cosine[:] += np.where(on, lean - slope, 0.0)


def _weighed(wood: Wood, params: WoodParams, left: np.ndarray, first: np.ndarray) -> Wood:
    """Return the bundle with masses, loads and grips of what is left (e,) of every edge.

    first (e,): whether an edge's first vertex is inside; of an edge that is cut, the end inside carries the stub.
    """
    rods, m = wood.rods, wood.motion
    count = len(m.x)
    whole = rods.alive == 1
    there = np.zeros(count, bool)
    there[rods.a[whole]] = there[rods.b[whole]] = True
    heavy = np.pi * rods.radius**2 * rods.rest * left * params.density
    mass = np.bincount(rods.a, np.where(whole, heavy / 2, np.where(first, heavy, 0.0)), count)
    mass += np.bincount(rods.b, np.where(whole, heavy / 2, np.where(first, 0.0, heavy)), count)
    mass[~there] = 0.0
    held = np.where(there, m.held, np.uint8(1)).astype(np.uint8)
    ends = wood.grid[:, -1]
    share = np.where(
        there[ends], rods.radius[np.searchsorted(wood.rod, np.arange(len(ends)), side="right") - 1] ** 2, 0
    )
    load = np.zeros((count, 3))
    if any(params.tip_load):
        load[ends] = share[:, None] / share.sum() * np.array(params.tip_load)
    load[:, 2] -= mass * params.gravity
    load[held == 1] = 0.0
    grips = courses(params, wood.straight, m.x, held == 0)
    motion = m._replace(
        v=np.where(there[:, None], m.v, 0.0),
        mass=np.where(mass > 0, params.mass_scaling * mass, 1.0),
        held=held,
        load=load,
    )
    return replace(wood, motion=motion, grips=grips, pins=pins_of(params, grips))
