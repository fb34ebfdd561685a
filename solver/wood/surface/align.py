"""What holds the cells of neighbours together, how their sections are turned, and where their corners meet.

Sutherland 2012, 5.2 moves every corner to the mean of itself and its associates, a fixed number of times. The limit of
these iterations is known: in a connected group it is the mean with weights of one more than the number of associates
(the matrix (D + 1)^-1 (A + 1) keeps it). It is taken at once, so that no gap is left and a stage does not depend on
which stages were shown before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..model.state import Wood
from .cells import Section
from .rows import Rows, Spans

__all__ = ["Pairs", "aligned", "bonded", "corners", "meeting", "turned"]

#: A bond speaks for a place no farther than this, over the longest edge as laid.
_SPEAKS = 0.75
#: Rods that bonds hold are never this far apart, over their distance as laid; shear moves them by less.
_FARTHEST = 2.0


class Pairs(NamedTuple):
    """Rods (p,) p < q whose cells share corners; of each shared corner (m,) its pair and its place in both cells."""

    p: np.ndarray
    q: np.ndarray
    pair: np.ndarray
    here: np.ndarray  # index into the section's corners, in p's cell
    there: np.ndarray  # the same corner in q's cell
    through: np.ndarray  # (n, 3) two rods meet (first) and both meet a third (second, last): numbers of pairs


def meeting(section: Section) -> Pairs:
    """Return which cells share corners."""
    order = np.argsort(section.corner, kind="stable")
    number = section.corner[order]
    here, there = [np.zeros(0, int)], [np.zeros(0, int)]
    # as many rods may share a corner as have merged there
    for away in range(1, int(np.bincount(number).max())):
        same = np.flatnonzero(number[away:] == number[:-away])
        here.append(order[same])
        there.append(order[same + away])
    a, b = np.concatenate(here), np.concatenate(there)
    swap = section.owner[a] > section.owner[b]
    a, b = np.where(swap, b, a), np.where(swap, a, b)
    key = section.owner[a] * len(section.points) + section.owner[b]
    unique, pair = np.unique(key, return_inverse=True)
    p, q = unique // len(section.points), unique % len(section.points)
    return Pairs(p, q, pair, a, b, _triangles(p, q, unique, len(section.points)))


def _triangles(p: np.ndarray, q: np.ndarray, unique: np.ndarray, rods: int) -> np.ndarray:
    """Return, of pairs p, q (n,), all triples (m, 3) of numbers of pairs that make a triangle, each pair first once."""
    beside: list[set[int]] = [set() for _ in range(rods)]
    for a, b in zip(p.tolist(), q.tolist(), strict=True):
        beside[a].add(b)
        beside[b].add(a)
    found = [
        (n, min(a, c) * rods + max(a, c), min(b, c) * rods + max(b, c))
        for n, (a, b) in enumerate(zip(p.tolist(), q.tolist(), strict=True))
        for c in sorted(beside[a] & beside[b])
    ]
    triples = np.array(found, int).reshape(-1, 3)
    triples[:, 1:] = np.searchsorted(unique, triples[:, 1:])
    return triples


def bonded(wood: Wood, span: Spans, pairs: Pairs) -> np.ndarray:
    """Return whether each pair holds together at each station (p, stations): whether the nearest bond does.

    Cells may meet whose rods stand too far apart for bonds: they hold while both hold to a third.
    """
    rods = len(wood.grid)
    holder = wood.rod[wood.bonds.i]
    place = span.start[wood.bonds.i] + wood.bonds.at * (span.end - span.start)[wood.bonds.i]
    other = wood.rod[wood.bonds.j]
    key = np.minimum(holder, other) * rods + np.maximum(holder, other)
    known = pairs.p * rods + pairs.q
    if not len(known) or not len(key):
        return np.zeros((len(known), span.stations), bool)
    number = np.clip(np.searchsorted(known, key), 0, len(known) - 1)
    mine = np.flatnonzero(known[number] == key)
    gap = 4 * span.length
    value = number[mine] * gap + place[mine]
    # of bonds at the same place, one that holds comes first
    order = np.lexsort((wood.bonds.on[mine] != 1, value))
    value, on = value[order], wood.bonds.on[mine][order] == 1
    asked = np.arange(len(known))[:, None] * gap + np.linspace(0, span.length, span.stations)
    right = np.searchsorted(value, asked)
    left = np.searchsorted(value, value[np.maximum(right - 1, 0)])
    right = np.minimum(right, len(value) - 1)
    nearer = np.where(np.abs(value[left] - asked) < np.abs(value[right] - asked), left, right)
    close = np.abs(value[nearer] - asked) <= _SPEAKS * float((span.end - span.start).max())
    holds: np.ndarray = close & on[nearer]
    never = np.ones(len(known), bool)
    never[number[mine]] = False
    far, first, second = pairs.through[never[pairs.through[:, 0]]].T
    while True:
        before = int(holds.sum())
        np.logical_or.at(holds, far, holds[first] & holds[second])
        if holds.sum() == before:
            return holds


def _together(
    rows: Rows, section: Section, pairs: Pairs, n: np.ndarray, k: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows a and b (m,) of the pairs n at the stations k, and which (m,) of those asked for they are.

    The nearest bond may hold what lies beyond a break: rows farther apart than any bond stretches are not together.
    """
    p, q = pairs.p[n], pairs.q[n]
    a, b = rows.at[p, k], rows.at[q, k]
    apart = np.linalg.norm(rows.point[b] - rows.point[a], axis=1)
    rest = np.linalg.norm(section.points[q] - section.points[p], axis=1)
    there = np.flatnonzero((a >= 0) & (b >= 0) & (apart < _FARTHEST * rest))
    return a[there], b[there], there


def turned(rows: Rows, section: Section, pairs: Pairs, holds: np.ndarray) -> np.ndarray:
    """Return where the section's y axis points (w, 3), turned about the tangents to fit the bonded neighbours.

    Without twist a rod's own frame does not know how the bundle turns. Rows without neighbours follow those of their
    piece that have some.
    """
    n, k = np.nonzero(holds)
    a, b, there = _together(rows, section, pairs, n, k)
    n = n[there]
    turn = np.zeros(len(rows.rod), complex)
    apart = rows.point[b] - rows.point[a]
    rest = section.points[pairs.q[n]] - section.points[pairs.p[n]]
    upward = np.cross(rows.tangent, rows.across)
    for row in (a, b):
        seen = (apart * rows.across[row]).sum(1) + 1j * (apart * upward[row]).sum(1)
        np.add.at(turn, row, seen * (rest[:, 0] - 1j * rest[:, 1]))
    size = np.abs(turn)
    sure = size > 1e-3 * section.radius**2
    turn[sure] /= size[sure]
    for piece in np.unique(rows.piece[~sure]):
        own = np.flatnonzero(rows.piece == piece)
        known = own[sure[own]]
        turn[own] = np.interp(rows.place[own], rows.place[known], turn[known]) if len(known) else 1.0
    turn /= np.maximum(np.abs(turn), 1e-12)
    found: np.ndarray = turn.real[:, None] * rows.across + turn.imag[:, None] * upward
    return found


def corners(rows: Rows, section: Section) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return each row's first corner (w + 1,), and of all corners (c,) their row and their number in the section."""
    sizes = np.diff(section.start)[rows.rod]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    row = np.repeat(np.arange(len(sizes)), sizes)
    return begin, row, section.start[rows.rod][row] + np.arange(begin[-1]) - begin[row]


def aligned(
    positions: np.ndarray, begin: np.ndarray, rows: Rows, section: Section, pairs: Pairs, holds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the group (c,) of every corner and the groups' places (g, 3) [m], from places (c, 3) of single corners."""
    m, k = np.nonzero(holds[pairs.pair])
    a, b, there = _together(rows, section, pairs, pairs.pair[m], k)
    m = m[there]
    first = begin[a] + pairs.here[m] - section.start[rows.rod[a]]
    second = begin[b] + pairs.there[m] - section.start[rows.rod[b]]
    count = len(positions)
    weight = 1.0 + np.bincount(first, minlength=count) + np.bincount(second, minlength=count)
    groups, group = connected_components(coo_matrix((np.ones(len(m)), (first, second)), (count, count)), directed=False)
    total = np.bincount(group, weight, groups)
    means = [np.bincount(group, weight * positions[:, axis], groups) / total for axis in range(3)]
    return group, np.column_stack(means)
