"""Bonds between the rods of a bundle as laid."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ...contract import InvalidGeometry
from ..net.shares import shares
from ..params import WoodParams
from ..shape.taper import thickness
from .arrays import Bonds, Rods
from .cracks import widths
from .curves import held
from .grain import Field, rayed, ringed
from .outline import area, corners, sawn_through

__all__ = ["bonded", "longest_edge", "lying", "moduli", "resolved", "stretched"]

#: The transverse spring of a bond over transverse modulus and volume: an isotropic planar net of springs of energy
#: density c eps_n^2 / 2 has the Young's modulus c / 3.
_NET = 3.0
#: Modulus [Pa] that stands for none.
_NONE = 1e-9
#: Edges on the length over which wood gives way ahead of a crack that opens, and ahead of one that slides.
_ZONE = 4.0, 5.5
#: The least share of its strength that a coarse bundle keeps.
_LEAST = 0.25
#: Strain and slope at which a bond must have given way, however coarse rods are.
_MOST_GIVEN = 0.4
#: How many times as far apart as in the stem rods of a fork's limbs no longer hold together.
_PARTED = 1.4
#: Rounds in which the place beside is found where fibres deviate; a round leaves an error of slope squared.
_TURNS = 4


def lying(
    x: np.ndarray, rods: Rods, i: np.ndarray, at: np.ndarray, j: np.ndarray, share: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the middles (b, 3) [m], lengths (b,) [m] and slopes along themselves (b,) of bonds between edges.

    x (v, 3) [m]; i (b,) edges, at (b,) where on them; j and share likewise. The slope is the mean of both rods'.
    """
    one, slope = held(x, rods, i, at)
    other, more = held(x, rods, j, share)
    d = one - other
    length = np.linalg.norm(d, axis=1)
    return (one + other) / 2, length, (0.5 * (slope + more) * d).sum(1) / np.maximum(length, 1e-300)


def stretched(x: np.ndarray, rods: Rods, bonds: Bonds) -> tuple[np.ndarray, np.ndarray]:
    """Return the length (b,) [m] of each bond, and the slope (b,) along it of the mean of the rods that it joins.

    x (v, 3) [m]: vertices.
    """
    _, length, slope = lying(x, rods, bonds.i, bonds.at, bonds.j, bonds.share)
    return length, slope


def moduli(
    params: WoodParams, log: WoodParams, straight: np.ndarray, rods: Rods, bonds: Bonds
) -> tuple[np.ndarray, ...]:
    """Return the moduli [Pa] across and in shear (b,) that bonds as laid stand for, with the grain's share.

    straight (v, 3) [m]: places in the straight bundle; log: what the bundle is hewn from.
    """
    part = straight[rods.b[bonds.i], 0] - straight[rods.a[bonds.i], 0]
    middle = (straight[rods.b[bonds.i], 0] + straight[rods.a[bonds.i], 0]) / 2
    section = area(corners(log)) * thickness(middle, params) ** 2
    volume = section * params.length * part / max(float(part.sum()), 1e-300)
    return bonds.k * bonds.rest / (_NET * volume), bonds.s / bonds.size


def resolved(params: WoodParams, edge: float, outline: np.ndarray) -> tuple[float, float]:
    """Return the strengths [Pa] across and along the grain at which bonds `edge` [m] apart begin to give way.

    Ahead of a crack's tip wood gives way over a length that follows from stiffness, toughness and strength: between
    two slender halves t thick over (E G_Ic t^3 / s^2)^(1/4) if it opens, over (E G_IIc t / s^2)^(1/2) if it slides
    (Cox and Marshall 1994). Where fewer than `_ZONE` edges lie on it, no bond feels the tip's stress, and the crack
    stays far beyond what it bears, to run all at once. A lower strength makes the zone longer, and changes nothing of
    what the crack costs (Turon et al. 2007); but never so low that bundles without a crack fall apart.
    """
    way = np.linalg.norm(np.roll(outline, -1, 0) - outline, axis=1).sum()
    thick = 2 * area(outline) / float(way)
    opens = (params.stiffness * params.toughness * thick**3) ** 0.5 / (_ZONE[0] * edge) ** 2
    slides = (params.stiffness * params.toughness_sliding * thick) ** 0.5 / (_ZONE[1] * edge)
    own = (params.cleavage, params.shear_strength)
    return min(own[0], max(opens, _LEAST * own[0])), min(own[1], max(slides, _LEAST * own[1]))


def longest_edge(params: WoodParams, outline: np.ndarray) -> float:
    """Return the length [m] beyond which edges feel no crack's tip, however weak `resolved` may make the bonds.

    Twice as long, a double cantilever beam bore 1.6 times what it should (docs/wood.md).
    """
    way = np.linalg.norm(np.roll(outline, -1, 0) - outline, axis=1).sum()
    thick = 2 * area(outline) / float(way)
    opens = ((params.stiffness * params.toughness * thick**3) ** 0.5 / (_LEAST * params.cleavage)) ** 0.5
    slides = (params.stiffness * params.toughness_sliding * thick) ** 0.5 / (_LEAST * params.shear_strength)
    return float(min(opens / _ZONE[0], slides / _ZONE[1]))


def _begins(own: np.ndarray, resolved_: np.ndarray, cost: np.ndarray, holds: np.ndarray) -> np.ndarray:
    """Return the energy (b,) [J] at which bonds begin to give way, by the wood's own strength and the resolved one.

    It ends where the square of separation is cost^2 over this: no farther than at `_MOST_GIVEN`, holds [J] at 1.
    """
    least = cost**2 / np.maximum(holds * _MOST_GIVEN**2, 1e-300)
    found: np.ndarray = np.minimum(own, np.maximum(resolved_, least))
    return found


def _beside(one: np.ndarray, other: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return where along (m,) [m] the fibre through other (n, 3) passes square to edges of one (n, 3).

    middle (m,): places along of the middles of these edges.
    """
    t = one[1:] - one[:-1]
    t /= np.linalg.norm(t, axis=1)[:, None]
    centre, place = (one[1:] + one[:-1]) / 2, middle
    for _ in range(_TURNS):
        there = np.column_stack([np.interp(place, other[:, 0], other[:, c]) for c in range(3)])
        place = np.clip(place + ((centre - there) * t).sum(1) / t[:, 0], other[0, 0], other[-1, 0])
    return place


def _closest(pairs: np.ndarray, s: np.ndarray, course: np.ndarray | None, edge: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the edges (b,) of the first rod of each pair (m, 2), the edges (b,) of the second one that their middles
    are closest to, how far along those (b,), and how long (b,) [m] the first ones are.
    """
    one, on, share, long = [np.zeros(0, np.int32)], [np.zeros(0, np.int32)], [np.zeros(0)], [np.zeros(0)]
    for p, q in pairs:
        # straight rods are parallel at rest: the closest point lies at the same place along
        middle = (s[p][1:] + s[p][:-1]) / 2
        if course is not None:
            middle = _beside(course[p], course[q], middle)
        j = np.clip(np.searchsorted(s[q], middle) - 1, 0, s.shape[1] - 2)
        one.append(edge[p][: len(middle)])
        on.append(edge[q][j])
        share.append(np.clip((middle - s[q][j]) / (s[q][j + 1] - s[q][j]), 0, 1))
        long.append(np.diff(s[p]))
    return np.concatenate(one), np.concatenate(on), np.concatenate(share), np.concatenate(long)


def bonded(
    params: WoodParams,
    log: WoodParams,
    points: np.ndarray,
    s: np.ndarray,
    course: np.ndarray | None,
    edge: np.ndarray,
    rest: np.ndarray,
    rods: Rods,
    grain: Field,
    strong: Field,
) -> Bonds:
    """Bond the middles of edges to the closest points of rods within reach, each pair of rods once.

    A bond along the stress begins to give way at the strain of the strength, in tension and in shear.

    points (k, 2) in the section, s (k, n) places along, course (k, n, 3) [m] places in the straight bundle where fibres
    deviate, edge (k, n - 1) edge numbers, rest (v, 3) places at rest; log: what the bundle is hewn from.

    Raises:
        InvalidGeometry: two rods stand at one place.

    """
    outline = corners(log)
    near = params.reach * float(np.sqrt(area(outline) / len(points)))
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T)] if len(pairs) else np.zeros((0, 2), int)
    n = s.shape[1]
    crack = np.repeat(widths(points, pairs, outline, sawn_through(log)), n - 1)
    section = np.pi * rods.radius[edge].max(1) ** 2
    bears = shares(points, pairs, section, outline, params.turning)
    # by turns from the one rod and from the other
    pairs[1::2] = pairs[1::2, ::-1]
    i, e, u, part = _closest(pairs, s, course, edge)
    at = np.full(len(i), 0.5)
    _, length, cosine = lying(rest, rods, i, at, e, u)
    # the grain is that of the straight, even bundle
    along = ((s[:, 1:] + s[:, :-1]) / 2)[pairs[:, 0]].ravel()
    centre, way = (np.repeat(f, n - 1, 0) for f in (points[pairs].mean(1), np.diff(points[pairs], axis=1)[:, 0]))
    middle = np.column_stack([along, centre])
    if len(i) and not length.min() > 0:
        raise InvalidGeometry("two rods stand at the same place.", advice="Take fewer rods or a wider bundle.")
    thin = thickness(along, params)
    volume = area(outline) * thin**2 * params.length * part / max(float(part.sum()), 1e-300)
    stiff = grain.factor(middle, params.grain.stiffness)
    # early wood comes apart as much more easily as it is softer; toughness goes with the square of this
    early = ringed(params.grain, middle[:, 1:], length / 2) ** 0.5
    strength = strong.strength(middle, params.grain.strength) * early * rayed(params.grain, middle[:, 1:], way)
    springs = _NET * params.transverse * volume / np.maximum(length, 1e-300) * stiff
    size = volume * np.repeat(bears, n - 1)
    sheared = params.shear * size * stiff
    crack = crack * thin
    torn, shorn = (g * crack * part * strength**2 for g in (params.toughness, params.toughness_sliding))
    per_opening = _NET / 2 / max(params.transverse, _NONE) * volume * strength**2
    per_shear = size / max(params.shear, _NONE) * strength**2
    cleavage, shear_strength = resolved(params, params.length / (n - 1), corners(params))
    found = Bonds(
        i.astype(np.int32),
        at,
        e.astype(np.int32),
        u,
        length,
        springs,
        sheared,
        size,
        cosine,
        _begins(per_opening * params.cleavage**2, per_opening * cleavage**2, torn, 0.5 * springs * length),
        _begins(per_shear * params.shear_strength**2, per_shear * shear_strength**2, shorn, sheared),
        torn,
        shorn,
        crack * part,
        np.zeros(len(i)),
        np.zeros(len(i)),
        np.ones(len(i), np.uint8),
    )
    if params.fork is None:
        return found
    # in the crotch limbs hold together as far as they have not parted
    near = length < _PARTED * thin * np.hypot(*way.T)
    return Bonds(*(a[near] for a in found))
