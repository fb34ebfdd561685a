"""Saw cuts through bonds and rods.

A rod has a vertex where a cut passes it, and is parted there: with the vertices of all rods that are cut on one plane,
no bond, which begins in the middle of an edge, holds on to both of its sides. Beside it shear and opening rise to the
cut, and one bond an edge would leave half an edge on each side without any: a stick sawn half through would bend by a
tenth more at preview than at fine. So the bonds there are divided.
"""

from __future__ import annotations

import math

import numpy as np

from ...contract import InvalidGeometry
from ..params import Cut, WoodParams
from .arrays import Bonds, Rods
from .curves import held
from .joining import lying

__all__ = ["boxes", "divided", "loosened", "meets", "passed", "placed_on", "sawn"]

#: No slice is thinner than this, over the mean edge: its edges would shorten the step of all.
_THINNEST = 0.25
#: A rod that passes a cut nearer to an end than this share of the thinnest slice is not parted; and how near to a cut,
#: over the bundle's length, a place is on it.
_LEFT, _ON = 0.5, 1e-9
#: Where on their edges the parts of a bond beside a cut sit; and how near to a cut edges are, over the mean edge: not
#: those behind the next vertex of even rods.
_PARTS, _NEAR = (1 / 6, 1 / 2, 5 / 6), 0.999

#: What the parts of a bond share.
_SHARED = ("k", "s", "size", "opens", "slides", "torn", "shorn", "area")


def boxes(params: WoodParams, vertices: int) -> tuple[Cut, ...]:
    """Return the cuts, those that would leave too thin a slice at an end moved along, as thick as it may be."""
    least = _THINNEST * params.length / (vertices - 1)
    found = []
    for cut in params.cuts:
        middle = (cut.low[0] + cut.high[0]) / 2
        if 0 < middle < params.length:
            shift = min(max(middle, least), params.length - least) - middle
            low, high = ((box[0] + shift, *box[1:]) for box in (cut.low, cut.high))
            cut = cut.model_copy(update={"low": low, "high": high})
        found.append(cut)
    return tuple(found)


def _passage(first: np.ndarray, second: np.ndarray, box: Cut) -> tuple[np.ndarray, np.ndarray]:
    """Return where (n,), 0 to 1, segments (n, 3) to (n, 3) come into a box, which may be flat, and leave it.

    One that does not meet it leaves before it comes.
    """
    low, high = np.zeros(len(first)), np.ones(len(first))
    for c in range(3):
        d = second[:, c] - first[:, c]
        flat = d == 0
        safe = np.where(flat, 1.0, d)
        p, q = (box.low[c] - first[:, c]) / safe, (box.high[c] - first[:, c]) / safe
        within = (first[:, c] >= box.low[c]) & (first[:, c] <= box.high[c])
        low = np.where(flat, np.where(within, low, np.inf), np.maximum(low, np.minimum(p, q)))
        high = np.where(flat, high, np.minimum(high, np.maximum(p, q)))
    return low, high


def sawn(cuts: tuple[Cut, ...], straight: np.ndarray, rods: Rods, bonds: Bonds) -> None:
    """Break the bonds that cuts go through; straight (v, 3): places in the straight bundle [m]."""
    if not len(bonds.i) or not cuts:
        return
    first = held(straight, rods, bonds.i, bonds.at)[0]
    second = held(straight, rods, bonds.j, bonds.share)[0]
    for cut in cuts:
        comes, leaves = _passage(first, second, cut)
        _break(bonds, comes <= leaves)


def meets(cut: Cut, straight: np.ndarray, rods: Rods, bonds: Bonds) -> bool:
    """Return whether a cut passes a rod or a bond; straight (v, 3): places in the straight bundle, as laid [m]."""
    ends = [(straight[rods.a], straight[rods.b])]
    if len(bonds.i):
        ends.append((held(straight, rods, bonds.i, bonds.at)[0], held(straight, rods, bonds.j, bonds.share)[0]))
    return any(bool(np.less_equal(*_passage(one, other, cut)).any()) for one, other in ends)


def passed(straight: np.ndarray, cut: Cut, length: float) -> list[list[float]]:
    """Return where along [m] each of k rods with vertices at straight (k, n, 3) [m] passes a cut: where it is halfway
    through; where an end lies in it, in the middle of the box, if that is in the wood.
    """
    count = len(straight)
    first, second = straight[:, :-1].reshape(-1, 3), straight[:, 1:].reshape(-1, 3)
    comes, leaves = _passage(first, second, cut)
    own, way = np.repeat(np.arange(count), straight.shape[1] - 1), second[:, 0] - first[:, 0]
    found: list[list[float]] = [[] for _ in range(count)]
    begun, last = 0.0, (-1, -1.0)
    for e in np.flatnonzero(comes <= leaves).tolist():
        rod, enters = int(own[e]), float(first[e, 0] + comes[e] * way[e])
        if last == (rod, enters):
            # it is in it from the edge before
            found[rod].pop()
        else:
            begun = enters
        ends = float(first[e, 0] + leaves[e] * way[e])
        last = rod, ends
        found[rod].append(_halfway(begun, ends, cut, length))
    return [[at for at in places if math.isfinite(at)] for places in found]


def _halfway(begun: float, ends: float, cut: Cut, length: float) -> float:
    """Return where a rod that is in a cut from `begun` to `ends` [m] is parted; nan: nowhere."""
    middle = (begun + ends) / 2
    if not 0 < begun <= ends < length:
        middle = (cut.low[0] + cut.high[0]) / 2
    return middle if begun <= middle <= ends else math.nan


def placed_on(
    cuts: tuple[Cut, ...], s: np.ndarray, straight: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return places along (k, n) [m] with a vertex of each rod where a cut passes it, and those (p, 2): rod, vertex.

    s (k, n) [m], straight (k, n, 3) [m]: where vertices would be. Between two cuts and the ends a rod's vertices move
    evenly: so edges get by as much shorter or longer as the nearest vertex moves, over the way to the next cut.

    Raises:
        InvalidGeometry: a rod is cut more often than it has vertices between its ends.

    """
    count = s.shape[1]
    least = _THINNEST * length / (count - 1)
    moved, found = s.copy(), []
    through = [passed(straight, cut, length) for cut in cuts]
    for rod in range(len(s)):
        wanted: list[float] = []
        for at in sorted(place for places in through for place in places[rod]):
            if min(at, length - at) < _LEFT * least:
                continue
            if not wanted or at - wanted[-1] >= least:
                wanted.append(min(max(at, least), length - least))
        if not wanted:
            continue
        if len(wanted) > count - 2:
            raise InvalidGeometry(
                f"a rod of {count} vertices is sawn through at {len(wanted)} places.",
                advice="Take more vertices than there are cuts along a rod, or fewer cuts.",
            )
        vertex = np.abs(s[rod][:, None] - np.array(wanted)).argmin(0)
        for n in range(len(wanted)):
            vertex[n] = max(vertex[n], vertex[n - 1] + 1 if n else 1)
        for n in reversed(range(len(wanted))):
            vertex[n] = min(vertex[n], vertex[n + 1] - 1 if n + 1 < len(wanted) else count - 2)
        knots = np.array([0, *vertex, count - 1])
        moved[rod] = np.interp(s[rod], s[rod][knots], [0.0, *wanted, length])
        found += [(rod, int(v)) for v in vertex]
    return moved, np.array(found, np.int32).reshape(-1, 2)


def loosened(
    cuts: tuple[Cut, ...],
    straight: np.ndarray,
    places: np.ndarray,
    owner: np.ndarray,
    rods: Rods,
    bonds: Bonds,
    length: float,
) -> None:
    """Break the bonds that hold on to a rod between where it passes a cut and where it is parted for it.

    There a rod is beyond the cut, and not parted from what is before it: no slice is thinner than a quarter of an edge.

    straight (k, n, 3) [m]: vertices; places (p,) [m] along at which the rods owner (p,) are parted; length [m]: of the
    bundle.
    """
    ways: list[list[tuple[float, float]]] = [[] for _ in range(len(straight))]
    for cut in cuts:
        for rod, found in enumerate(passed(straight, cut, length)):
            ends = np.array([0.0, length, *places[owner == rod]])
            for at in found:
                nearest = float(ends[np.abs(ends - at).argmin()])
                if abs(nearest - at) > _ON * length:
                    ways[rod].append((min(at, nearest), max(at, nearest)))
    x, edges = straight[..., 0].ravel(), straight.shape[1] - 1
    for edge, share in ((bonds.i, bonds.at), (bonds.j, bonds.share)):
        along = x[rods.a[edge]] + share * (x[rods.b[edge]] - x[rods.a[edge]])
        for rod in np.flatnonzero([bool(way) for way in ways]).tolist():
            mine = np.flatnonzero(edge // edges == rod)
            for low, high in ways[rod]:
                _break(bonds, mine[(along[mine] >= low) & (along[mine] <= high)])


def _break(bonds: Bonds, which: np.ndarray) -> None:
    """Break bonds, of which one says whether (b,) or which they are."""
    bonds.damage[which] = 1.0
    bonds.parted[which] = 1.0
    bonds.on[which] = 2


def divided(bonds: Bonds, rods: Rods, straight: np.ndarray, rest: np.ndarray, where: np.ndarray, near: float) -> Bonds:
    """Return bonds, those on edges beside a cut in parts along the edge, that are together what they were.

    straight, rest (v, 3) [m]: vertices in the straight and in the unloaded bundle; where (e, c) [m]: places along at
    which the edge's rod is sawn, nan for none; near [m]: the mean edge.
    """
    x = straight[:, 0]
    low, high = (x[end[bonds.i]][:, None] for end in (rods.a, rods.b))
    reach = _NEAR * near
    at = np.concatenate([where[bonds.i], where[bonds.j]], 1)
    mine = ((low < at + reach) & (high > at - reach)).any(1)
    if not mine.any():
        return bonds
    one = Bonds(*(a[mine] for a in bonds))
    begins, wide = (values[mine, 0] for values in (low, high - low))
    across = x[rods.a[one.j]] + one.share * (x[rods.b[one.j]] - x[rods.a[one.j]]) - begins - 0.5 * wide
    parts = [Bonds(*(a[~mine] for a in bonds))]
    for part in _PARTS:
        j, share = _found(begins + part * wide + across, one.j, rods, x)
        seat = np.full(len(j), part)
        _, length, cosine = lying(rest, rods, one.i, seat, j, share)
        less = {name: getattr(one, name) / len(_PARTS) for name in _SHARED}
        less["k"] *= one.rest / length
        parts.append(one._replace(at=seat, j=j, share=share, rest=length, cosine=cosine, **less))
    return Bonds(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _found(wanted: np.ndarray, edge: np.ndarray, rods: Rods, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges (b,) of the rods of `edge` (b,) that are at places wanted (b,) [m] along, and where on them."""
    last = len(rods.a) - 1
    while True:
        behind, before = np.minimum(edge + 1, last), np.maximum(edge - 1, 0)
        on = (wanted >= x[rods.b[edge]]) & (rods.a[behind] == rods.b[edge]) & (rods.k[behind] > 0)
        back = (wanted < x[rods.a[edge]]) & (rods.b[before] == rods.a[edge]) & (rods.k[before] > 0)
        if not (on | back).any():
            break
        edge = np.where(on, behind, np.where(back, before, edge)).astype(np.int32)
    low, high = x[rods.a[edge]], x[rods.b[edge]]
    return edge, np.clip((wanted - low) / (high - low), 0, 1)
