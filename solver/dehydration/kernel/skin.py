"""The outer skin inside the time loop: its nodes as floats for `contact`, and its pushes back on the state."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from solver.dehydration.contact.contact import depart, resolve
from solver.dehydration.contact.data import HELD, HITS, READS, SHARES, Contact, grow, make_contact
from solver.dehydration.contact.search import find_pairs
from solver.dehydration.kernel.fixed_point import QUANTUM, positions
from solver.dehydration.kernel.layout import Layout

from ...arrays import Bools, Ints, Ints32, Singles

OPTIONS: Any = {"error_model": "numpy"}
"""No cache of their own: numba would keep what they inline from other files. The loop that calls them is cached."""
UNIT = np.float32(QUANTUM)
QUANTA = np.float32(1 / QUANTUM)


class Skin(NamedTuple):
    """Scratch of the loop; a named tuple because numba reads those natively. ns surface nodes."""

    contact: Contact
    """in the numbering of the skin: its state is `position`, not the fruit's"""
    rows: Ints32
    """(ns,) node of the fruit, or the one that it is a mirror image of"""
    sign: Singles
    """(ns, 3) of its coordinates: -1 where it is an image"""
    own: Bools
    """(ns,) whether it is that node itself: images are read, never written"""
    share: Singles
    """(ns,) of its mass that the fruit carries: half on a mirror plane"""
    position: Singles
    """(ns, 4)"""
    velocity: Singles
    """(ns, 4)"""
    inverse_mass: Singles
    """(ns,)"""
    below: Singles
    """(ns, 2) of a push on a node, what the next two inwards get where they share their masses with it, else 0"""


def make_skin(
    layout: Layout,
    surface_nodes: ArrayLike,
    quads: ArrayLike,
    clearance: float,
    *,
    sign: ArrayLike | None = None,
    own: ArrayLike | None = None,
    share: ArrayLike | None = None,
) -> Skin:
    """Self-contact of the surface `surface_nodes` (ns,), `quads` (nq, 4) in surface numbering, outward.

    clearance: gap that contact keeps. te: thickness of the exocarp; both in the layout's unit of length. sign, own,
    share: see `Skin`; without them no node is an image.
    """
    rows = np.ascontiguousarray(surface_nodes, np.int32)
    signs = np.ones((len(rows), 3)) if sign is None else np.asarray(sign)
    shares = np.ones(len(rows)) if share is None else np.asarray(share)
    owned = np.ones(len(rows), np.bool_) if own is None else np.ascontiguousarray(own, np.bool_)
    first = np.zeros(layout.nodes, np.int64)
    first[rows[owned]] = np.flatnonzero(owned)
    rest = positions(layout.fresh)[rows] * signs
    return Skin(
        make_contact(np.arange(len(rows)), quads, rest, clearance, source=first[rows]),
        rows,
        np.ascontiguousarray(signs, np.float32),
        owned,
        np.ascontiguousarray(shares, np.float32),
        np.zeros((len(rows), 4), np.float32),
        np.zeros((len(rows), 4), np.float32),
        layout.inverse_mass[rows] * shares.astype(np.float32),
        _below(layout, rows),
    )


def _below(layout: Layout, rows: Ints32) -> Singles:
    """Of a push on the nodes `rows`, what the next two inwards get: M^-1 of both over M^-1 of the node itself."""
    found = np.zeros((layout.nodes, 2), np.float32)
    if len(layout.tops):
        found[layout.tops] = layout.spread[:, [5, 4]]
    below: Singles = found[rows]
    return below


def weigh(skin: Skin, layout: Layout) -> None:
    """Take the layout's masses."""
    skin.inverse_mass[:] = layout.inverse_mass[skin.rows] * skin.share
    skin.below[:] = _below(layout, skin.rows)


def forget(skin: Skin, layout: Layout) -> None:
    """Take the layout's masses and drop all that earlier steps left: the next march depends on its state alone."""
    weigh(skin, layout)
    skin.contact.searched[:] = 1e15
    skin.contact.counts[:] = 0


def widen(skin: Skin) -> Skin:
    """The same skin with room for all the pairs that the last search wanted."""
    return skin._replace(contact=grow(skin.contact, int(skin.contact.counts[1])))


@njit(**OPTIONS, forceinline=True)
def _read_node(
    rows: Ints32, sign: Singles, position: Singles, speed: Singles, state: Ints32, velocity: Singles, i: int
) -> None:
    first = 4 * np.int64(rows[i])
    for k in range(3):
        position[i, k] = sign[i, k] * (np.float32(state[first + k]) * UNIT)
        speed[i, k] = sign[i, k] * velocity[first + k]


@njit(**OPTIONS)
def search(skin: Skin, state: Ints32, velocity: Singles) -> bool:
    """Look for pairs that may touch, at positions and velocities of the flat state (4 nn,) int32 and velocity (4 nn,).

    False if there are more than the contact has room for.
    """
    rows, sign, position, speed = skin.rows, skin.sign, skin.position, skin.velocity
    for i in range(rows.size):
        _read_node(rows, sign, position, speed, state, velocity, i)
    return bool(find_pairs(skin.contact, skin.position) <= skin.contact.pairs.shape[0])


@njit(**OPTIONS, forceinline=True)
def approach(
    rows: Ints32, sign: Singles, position: Singles, speed: Singles, reads: Ints32, counts: Ints, before: Singles,
    searched: Singles, surface_nodes: Ints32, extremes: Singles, state: Ints32, velocity: Singles, share: int,
) -> None:  # fmt: skip
    """Read a share of the nodes that may touch, after the step just made.

    The arrays are those of `Skin` and `Contact` by the same names: a parallel loop takes no tuples.
    """
    first, last = share * counts[READS] // SHARES, (share + 1) * counts[READS] // SHARES
    for place in range(first, last):
        _read_node(rows, sign, position, speed, state, velocity, reads[place])
    depart(before, searched, surface_nodes, reads, position, speed, extremes, share, first, last)


@njit(**OPTIONS, forceinline=True)
def _write_node(
    rows: Ints32, own: Bools, below: Singles, speed: Singles, state: Ints32, velocity: Singles, i: int
) -> None:
    """Give the fruit what contact has changed of a node that is no image; a second time there is nothing to give."""
    if not own[i]:
        return
    first = 4 * np.int64(rows[i])
    for k in range(3):
        push = speed[i, k] - velocity[first + k]
        if push != 0:
            velocity[first + k] = speed[i, k]
            state[first + k] += np.int32(np.rint(push * QUANTA))
            for under in range(2):
                share = below[i, under]
                if share != 0:
                    place = first - 4 * (under + 1) + k
                    velocity[place] += share * push
                    state[place] += np.int32(np.rint(share * push * QUANTA))


@njit(**OPTIONS, forceinline=True)
def give(
    rows: Ints32, own: Bools, below: Singles, speed: Singles, reads: Ints32, counts: Ints, state: Ints32,
    velocity: Singles, share: int,
) -> None:  # fmt: skip
    """Give the fruit what contact has changed of a share of the nodes; arguments as in `approach`."""
    for place in range(share * counts[READS] // SHARES, (share + 1) * counts[READS] // SHARES):
        _write_node(rows, own, below, speed, state, velocity, reads[place])


@njit(**OPTIONS)
def keep_apart(skin: Skin, state: Ints32, velocity: Singles) -> bool:
    """Push touching skin apart in the step just made; returns whether each share is still to `give` it to the fruit.

    Few pushes are given here. Many share their nodes, and each node is looked at once at less cost.
    """
    contact = skin.contact
    resolve(contact, skin.position, skin.velocity, skin.inverse_mass)
    rows, own, below, speed, counts = skin.rows, skin.own, skin.below, skin.velocity, contact.counts
    pairs, hits, forces = contact.pairs, contact.hits, contact.hit_values
    if counts[HELD] != 0 or 4 * counts[HITS] > counts[READS]:
        return True
    for h in range(counts[HITS]):
        if forces[h, 1] != 0:
            for k in range(4):
                _write_node(rows, own, below, speed, state, velocity, pairs[hits[h], k])
    return False
