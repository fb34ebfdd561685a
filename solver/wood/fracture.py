"""Where rods break, and what a break does to the arrays; bonds give way in `cohesion`.

By `vertex` a rod breaks where mean edge ratio x bending ratio (Sutherland 2012, Eq. 3.24; h is the diameter) exceeds
1 + the strain limit. By `stress` it breaks anywhere: axial strain is even between the middles of edges, curvature
between hinges, and the strain of the outer fibre is held against the strength of each place. A break near a vertex
splits the vertex; one inside an edge ends its tension and leaves two stubs, which the neighbouring edges carry. So no
tiny edge is made and the stable step stays what it was.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit

from .model.arrays import Bonds, Rods
from .model.bundle import SAMPLES
from .model.joining import stretched
from .model.motion import Motion, Scratch
from .model.state import Wood

__all__ = ["Breaks", "bows", "break_worst", "overstress", "sawed", "sever", "strained"]

#: A break closer to a vertex than this, over the edge, is one at the vertex.
_NEAR = 0.25
_TINY = 1e-30
#: A bond beside a break is laid anew no shorter than this, over its length before.
_SHORTEST = 0.5


class Breaks(NamedTuple):
    """What one pass broke."""

    wood: Wood
    rods: int
    bonds: int  # left without a rod


@njit(cache=True, error_model="numpy")
def bows(
    rods: Rods, t: np.ndarray, theta: np.ndarray, reference: np.ndarray, bow: np.ndarray, turning: bool
) -> np.ndarray:
    """Return curvature beyond that at rest [1/m] and twist [radian/m] (h, 2) of whole hinges; 0 of broken ones."""
    out = np.zeros((len(rods.before), 2))
    for h in range(len(rods.before)):
        if rods.whole[h] == 0:
            continue
        p = rods.before[h]
        q = rods.after[h]
        if turning:
            # a curved axis is bent at rest, in a plane that its frames know
            out[h, 0] = bow[h]
            out[h, 1] = 2.0 * (theta[q] - theta[p] + reference[h]) / rods.span[h]
            continue
        c = t[p, 0] * t[q, 0] + t[p, 1] * t[q, 1] + t[p, 2] * t[q, 2]
        # 2 tan(phi / 2) over half the span
        out[h, 0] = 4.0 * np.sqrt(max(1.0 - c, 0.0) / max(1.0 + c, 1e-9)) / rods.span[h]
    return out


@njit(cache=True, error_model="numpy")
def overstress(
    rods: Rods,
    t: np.ndarray,
    inverse: np.ndarray,
    strength: np.ndarray,
    theta: np.ndarray,
    reference: np.ndarray,
    bow: np.ndarray,
    turning: bool,
    anywhere: bool,
    ratio: np.ndarray,
    place: np.ndarray,
) -> float:
    """Write strain over strength (e,) of every edge and where it is highest (e,) [0 to 1]; return the highest.

    Without `anywhere` an edge stands for the hinge at its first vertex (its place is 0), by Eq. 3.24. bow (h,): as
    `twist.turn` writes it, read if `turning`. Twist
    lengthens the outer fibre by sqrt(1 + (radius x twist)^2) (sec. 6.1).
    """
    bent = bows(rods, t, theta, reference, bow, turning)
    count = len(rods.a)
    ratio[:] = 0.0
    place[:] = 0.0
    top = 0.0
    last = strength.shape[1] - 1
    left = np.full(count, -1, np.int64)
    right = np.full(count, -1, np.int64)
    for h in range(len(rods.before)):
        if rods.whole[h] == 1:
            right[rods.before[h]] = h
            left[rods.after[h]] = h
    for e in range(count):
        if rods.alive[e] == 0 or rods.k[e] == 0.0:
            continue
        own = 1.0 / (inverse[e] * rods.rest[e]) - rods.free[e]
        r = rods.radius[e]
        h = left[e]
        g = right[e]
        # strain and curvature at both ends; beyond an end without a hinge nothing bends
        s0 = own
        s1 = own
        c0 = 0.0
        c1 = 0.0
        w0 = 0.0
        w1 = 0.0
        if h >= 0:
            p = rods.before[h]
            c0 = bent[h, 0]
            w0 = bent[h, 1]
            if rods.k[p] > 0.0:
                other = 1.0 / (inverse[p] * rods.rest[p]) - rods.free[p]
                s0 = (own * rods.rest[p] + other * rods.rest[e]) / (rods.rest[p] + rods.rest[e])
        if g >= 0:
            q = rods.after[g]
            c1 = bent[g, 0]
            w1 = bent[g, 1]
            if rods.k[q] > 0.0:
                other = 1.0 / (inverse[q] * rods.rest[q]) - rods.free[q]
                s1 = (own * rods.rest[q] + other * rods.rest[e]) / (rods.rest[q] + rods.rest[e])
        if not anywhere:
            if h < 0 or rods.k[rods.before[h]] == 0.0:
                continue
            # the mean of the two edges' ratios, as the thesis takes it, whatever their lengths
            p = rods.before[h]
            mean = 0.5 * (own + 1.0 / (inverse[p] * rods.rest[p]) - rods.free[p])
            long = (1.0 + mean) * (1.0 + r * c0) * np.sqrt(1.0 + (r * w0) ** 2) - 1.0
            ratio[e] = long / strength[e, 0]
            top = max(top, ratio[e])
            continue
        for m in range(last + 1):
            u = m / last
            strain = s0 + (own - s0) * 2.0 * u if u < 0.5 else own + (s1 - own) * (2.0 * u - 1.0)
            bow = (1.0 - u) * c0 + u * c1
            wring = (1.0 - u) * w0 + u * w1
            long = strain + r * bow + 0.5 * (r * wring) ** 2
            if long > ratio[e] * strength[e, m]:
                ratio[e] = long / strength[e, m]
                place[e] = u
        top = max(top, ratio[e])
    return top


def strained(wood: Wood, scratch: Scratch, anywhere: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the highest strain over strength, that of every edge (e,), and where on each it is (e,).

    scratch must hold the forces of the moment; anywhere: as `overstress` has it.
    """
    m, ratio, place = wood.motion, np.zeros(len(wood.rods.a)), np.zeros(len(wood.rods.a))
    top = overstress(
        wood.rods,
        scratch.t,
        scratch.inverse,
        wood.strength,
        m.theta,
        m.reference,
        scratch.bent,
        wood.turning,
        anywhere,
        ratio,
        place,
    )
    return top, ratio, place


def _split(wood: Wood, h: int) -> Wood:
    """Split the vertex of hinge h in two, one for each edge; mass and load by their shares, bonds stay on the edges."""
    m, rods = wood.motion, wood.rods
    p, q = int(rods.before[h]), int(rods.after[h])
    i, new = int(rods.b[p]), len(m.x)
    lengths = np.where(rods.k[[p, q]] > 0, rods.rest[[p, q]], 0.0)
    part = lengths[1] / lengths.sum()
    rods.whole[h] = 0
    rods.a[q] = new
    grown = {
        "x": np.vstack([m.x, m.x[i]]),
        "v": np.vstack([m.v, m.v[i]]),
        "mass": np.append(m.mass, m.mass[i] * part),
        "held": np.append(m.held, np.uint8(0)),
        "load": np.vstack([m.load, m.load[i] * part]),
    }
    grown["mass"][i] *= 1 - part
    grown["load"][i] *= 1 - part
    return replace(
        wood,
        motion=Motion(*(grown.get(name, getattr(m, name)) for name in Motion._fields)),
        parent=np.append(wood.parent, np.int32(i)),
    )


def _left(bonds: Bonds, mine: np.ndarray) -> int:
    """Drop bonds that are left without a rod; return how many of them were whole."""
    whole = int((bonds.on[mine] == 1).sum())
    bonds.on[mine] = 0
    return whole


def sever(wood: Wood, e: int, place: float) -> int:
    """Cut edge e at `place`; its bonds go to the neighbours that carry the stubs. Return how many bonds had none."""
    rods, bonds = wood.rods, wood.bonds
    ends = (
        np.flatnonzero((rods.after == e) & (rods.whole == 1)),
        np.flatnonzero((rods.before == e) & (rods.whole == 1)),
    )
    dropped = 0
    for edge, share in ((bonds.i, bonds.at), (bonds.j, bonds.share)):
        mine = np.flatnonzero((edge == e) & (bonds.on > 0))
        first = share[mine] < place
        if len(ends[0]):
            p = rods.before[ends[0][0]]
            edge[mine[first]] = p
            share[mine[first]] = 1 + share[mine[first]] * rods.rest[e] / rods.rest[p]
        else:
            dropped += _left(bonds, mine[first])
        if len(ends[1]):
            q = rods.after[ends[1][0]]
            edge[mine[~first]] = q
            share[mine[~first]] = (share[mine[~first]] - 1) * rods.rest[e] / rods.rest[q]
        else:
            dropped += _left(bonds, mine[~first])
    rods.alive[e] = 0
    for found in ends:
        rods.whole[found] = 0
    wood.cut[e] = place
    return dropped


def break_worst(wood: Wood, ratio: np.ndarray, place: np.ndarray, allowed: float) -> Breaks:
    """Break what rods are most overstressed, until they have released `allowed` [J]; the worst breaks in any case.

    ratio (e,) and place (e,) as from `overstress`. Beside a break a rod's curve is one-sided: by this alone a bond
    would be stretched and sheared, at a strong bend by many times what it bears, and what bonds hold would be made of
    nothing. So they are as if laid on the curve that is left: stretch, shear and energy stay what they were.
    """
    edges = np.flatnonzero(ratio > 1)
    rods = wood.rods
    mine, length, slope = _touched(wood, edges)
    spent, broken, gone = 0.0, 0, 0
    for e in map(int, edges[np.argsort(-ratio[edges], kind="stable")]):
        strain = float(wood.strength[e, round(float(place[e]) * (len(SAMPLES) - 1))]) * float(ratio[e])
        cost = 0.5 * float(rods.k[e] * rods.rest[e]) * strain**2
        if spent > 0 and spent + cost > allowed:
            break
        spent += cost
        if not rods.alive[e]:
            continue
        hinge = _hinge_near(rods, e, float(place[e]))
        if hinge >= 0:
            wood = _split(wood, hinge)
            rods = wood.rods
            broken += 1
        elif _NEAR <= place[e] <= 1 - _NEAR:
            gone += sever(wood, e, float(place[e]))
            broken += 1
        else:
            # the vertex beyond is already split or a clamp's: cut as close to it as a stub allows
            gone += sever(wood, e, _NEAR if place[e] < 0.5 else 1 - _NEAR)
            broken += 1
    _laid_again(wood, mine, length, slope)
    return Breaks(wood, broken, gone)


def _touched(wood: Wood, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the bonds (m,) of the rods of edges, their lengths (m,) [m] and slopes (m,).

    A break bends the curve of its own rod alone: all other bonds stay as they are.
    """
    bonds, near = wood.bonds, np.zeros(int(wood.rod.max()) + 1, bool)
    near[wood.rod[edges]] = True
    mine = np.flatnonzero(near[wood.rod[bonds.i]] | near[wood.rod[bonds.j]])
    return mine, *stretched(wood.motion.x, wood.rods, Bonds(*(a[mine] for a in bonds)))


def _laid_again(wood: Wood, mine: np.ndarray, length: np.ndarray, slope: np.ndarray) -> None:
    """Lay bonds (m,) on the curves that are left, as long and as sheared as they were."""
    bonds = wood.bonds
    later, lean = stretched(wood.motion.x, wood.rods, Bonds(*(a[mine] for a in bonds)))
    # no stiffer than the step bears
    longer = np.maximum(later / np.maximum(length, _TINY), _SHORTEST)
    bonds.rest[mine] *= longer
    bonds.k[mine] /= longer
    bonds.cosine[mine] += lean - slope


def _hinge_near(rods: Rods, e: int, place: float) -> int:
    """Return the whole hinge between real edges at which a break at `place` of edge e splits a vertex, or -1."""
    if _NEAR <= place <= 1 - _NEAR:
        return -1
    own, other = (rods.after, rods.before) if place < 0.5 else (rods.before, rods.after)
    found = np.flatnonzero((own == e) & (rods.whole == 1))
    if not len(found) or rods.k[other[found[0]]] == 0:
        return -1
    return int(found[0])


def sawed(wood: Wood) -> Wood:
    """Return a bundle as laid with the rods parted that saw cuts pass."""
    if not len(wood.sawn):
        return wood
    rods = wood.rods
    begins, ends = np.isin(rods.a, wood.sawn), np.isin(rods.b, wood.sawn)
    mine, length, slope = _touched(wood, np.flatnonzero(begins))
    for edge, share in ((wood.bonds.i, wood.bonds.at), (wood.bonds.j, wood.bonds.share)):
        # the stub of a rod that runs out of the wood is carried from beyond the cut no more
        _left(wood.bonds, np.flatnonzero((begins[edge] & (share < 0)) | (ends[edge] & (share > 1))))
    for i in wood.sawn.tolist():
        # a rod that runs out of the wood may end here
        for h in np.flatnonzero((rods.b[rods.before] == i) & (rods.whole == 1)).tolist():
            wood = _split(wood, h)
    _laid_again(wood, mine, length, slope)
    return wood
