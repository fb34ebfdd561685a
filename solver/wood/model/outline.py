"""The outline of the section: a disk, or any simple polygon; and rods that stand evenly in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ...contract import InvalidGeometry
from ..params import WoodParams
from ..shape.taper import thickness
from .section import areas, balanced, place

__all__ = ["Standing", "area", "chords", "corners", "covered", "drawn_in", "facing", "inside", "sawn_through", "stand"]

#: Corners of the polygon that stands for a disk, of the disk's area.
_DISK = 96
#: Points of the section per rod by which cells are measured, and rounds of evening out (Lloyd 1982).
_PER_ROD, _FEWEST, _ROUNDS = 400, 20_000, 60
#: Rods in one line have no second moment across it, of the other, that could be put right.
_FLAT = 1e-3
#: Of a rod's mean section, the least part of the section that a saw divides.
_SLIVER = 0.4


class Standing(NamedTuple):
    """Where k rods stand in the section."""

    points: np.ndarray  # (k, 2) [m]
    area: np.ndarray  # (k,) [m2], together the section's
    least: float  # least distance of two of them before they were balanced [m]


def area(outline: np.ndarray) -> float:
    """Return the area [m2] of a polygon (m, 2), positive if its corners run counter-clockwise."""
    y, z = outline.T
    return float(y @ np.roll(z, -1) - z @ np.roll(y, -1)) / 2


def corners(params: WoodParams) -> np.ndarray:
    """Return the outline's corners (m, 2) [m], counter-clockwise about +x, its centroid at the origin."""
    if not params.outline:
        turn = 2 * np.pi * np.arange(_DISK) / _DISK
        reach = params.radius * np.sqrt(2 * np.pi / (_DISK * np.sin(2 * np.pi / _DISK)))
        disk: np.ndarray = reach * np.column_stack([np.cos(turn), np.sin(turn)])
        return disk
    found = np.array(params.outline, float)
    if area(found) < 0:
        found = found[::-1].copy()
    following = np.roll(found, -1, 0)
    cross = found[:, 0] * following[:, 1] - found[:, 1] * following[:, 0]
    centred: np.ndarray = found - ((found + following) * cross[:, None]).sum(0) / (3 * cross.sum())
    return centred


def inside(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return whether points (n, 2) are inside a polygon (m, 2): an odd number of its sides is to their right."""
    odd = np.zeros(len(points), bool)
    y, z = points.T
    for (y0, z0), (y1, z1) in zip(outline, np.roll(outline, -1, 0), strict=True):
        if z0 != z1:
            odd ^= ((z0 > z) != (z1 > z)) & (y < y0 + (z - z0) * (y1 - y0) / (z1 - z0))
    return odd


def _depths(outline: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how deep (n,) [m] points (n, 2) are in a polygon (m, 2), and the nearest side's inner normal (n, 2)."""
    nearest, normal = np.full(len(points), np.inf), np.zeros((len(points), 2))
    for first, second in zip(outline, np.roll(outline, -1, 0), strict=True):
        way = second - first
        size = max(float(np.hypot(*way)), 1e-300)
        along = np.clip((points - first) @ way / size**2, 0, 1)
        away = np.linalg.norm(points - first - along[:, None] * way, axis=1)
        closer = away < nearest
        nearest[closer], normal[closer] = away[closer], np.array([-way[1], way[0]]) / size
    return np.where(inside(outline, points), nearest, -nearest), normal


def drawn_in(outline: np.ndarray, points: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """Return points (n, 2) moved to the centroids of what of their cells, wide (n,) [m], lies within a polygon (m, 2).

    The side nearest to a point cuts its cell straight: what corners and further sides cut off is left out.
    """
    depth, normal = _depths(outline, points)
    moved: np.ndarray = points + np.clip(wide / 4 - depth / 2, 0, wide / 2)[:, None] * normal
    return moved


def covered(outline: np.ndarray, points: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """Return the share (n,) of cells wide (n,) [m] that lies within a polygon (m, 2), of points (n, 2) as drawn in."""
    found: np.ndarray = np.clip(2 * _depths(outline, points)[0] / wide, 0, 1)
    return found


def facing(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the inner normal (n, 2) of the side of a polygon (m, 2) that is nearest to points (n, 2)."""
    return _depths(outline, points)[1]


def chords(outline: np.ndarray, normal: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return how long (n,) [m] the lines {p: p.normal = offset} (n, 2), (n,) are within a polygon (m, 2)."""
    way = np.column_stack([-normal[:, 1], normal[:, 0]])
    found = np.zeros(len(offset))
    for first, second in zip(outline, np.roll(outline, -1, 0), strict=True):
        a, b = normal @ first - offset, normal @ second - offset
        hit = (a < 0) != (b < 0)
        share = np.where(hit, a / np.where(hit, a - b, 1.0), 0.0)
        along = way @ first + share * (way @ (second - first))
        # where the outline goes out of the half plane a chord ends, where it goes in one begins
        found += np.where(hit, np.where(a < 0, -along, along), 0.0)
    return np.abs(found)


def stand(params: WoodParams, generator: np.random.Generator) -> Standing:
    """Return where rods stand: in a disk as the thesis has them, in a polygon evened out to cells of one size.

    What a saw cut along the grain divides is evened out on each side of it: cells that lie across it would make one
    side thicker than the other, and both stiffer than they are.

    Raises:
        InvalidGeometry: two rods stand at the same place.

    """
    if params.outline or sawn_through(params):
        return _even(corners(params), params.rods, generator, sawn_through(params))
    points, least = place(params.rods, params.radius, generator)
    if not least > 0:
        raise InvalidGeometry("two rods stand at the same place.", advice="Take fewer rods or a wider bundle.")
    section = areas(points, params.radius)
    return Standing(balanced(points, section, params.radius), section, least)


def sawn_through(params: WoodParams) -> list[tuple[int, float]]:
    """Return the lines (0: y, 1: z; value [m]) in the section at which saw cuts end that reach from rim to rim.

    A cut along the grain parts the section along its line, one across is as deep as the line to which it goes, and one
    with a width has a line on each side. Where fibres deviate, a cut across meets other rods than stand there.
    """
    outline, found = corners(params), set()
    low, high = outline.min(0), outline.max(0)
    for cut in params.cuts:
        along = cut.low[0] < cut.high[0]
        if not along and params.grain.deviates:
            continue
        thin = 1.0 if along else float(thickness(np.array(cut.low[0]), params))
        for c in (0, 1):
            other = 1 - c
            across = cut.low[other + 1] <= low[other] * thin and cut.high[other + 1] >= high[other] * thin
            faces = {cut.low[c + 1] / thin, cut.high[c + 1] / thin}
            if across and (along or len(faces) == 2):
                found |= {(c, at) for at in faces if low[c] < at < high[c]}
    return sorted(found)


def _shared(rods: int, size: np.ndarray) -> np.ndarray:
    """Return how many of the rods each part gets by its size, at least one each (largest remainders)."""
    share = rods * size / size.sum()
    found: np.ndarray = np.maximum(np.floor(share).astype(int), 1)
    for n in np.argsort(found - share, kind="stable")[: max(rods - int(found.sum()), 0)]:
        found[n] += 1
    return found


def _even(outline: np.ndarray, rods: int, generator: np.random.Generator, lines: list[tuple[int, float]]) -> Standing:
    """Return rods at the centroids of their cells, drawn together so that each part keeps its second moments."""
    low, wide = outline.min(0), np.ptp(outline, axis=0)
    share = area(outline) / float(wide.prod())
    count = int(max(_FEWEST, _PER_ROD * rods) / share)
    # an additive recurrence fills a rectangle evenly (Roberts 2018: the plastic number)
    steps = np.arange(1, count + 1)[:, None] * np.array([0.7548776662466927, 0.5698402909980532])
    fine = low + wide * ((0.5 + steps) % 1)
    fine = fine[inside(outline, fine)]
    side = _sides(fine, lines, _SLIVER * len(fine) / rods)
    parts = [fine[side == n] for n in np.unique(side)]
    each = area(outline) / len(fine)
    found = [
        _kept(part, *_cells(part, own, generator), each)
        for part, own in zip(parts, _shared(rods, np.array([len(p) for p in parts])), strict=True)
    ]
    points, size = (np.concatenate(values) for values in zip(*found, strict=True))
    if size.min() == 0:
        raise InvalidGeometry("two rods stand at the same place.", advice="Take fewer rods or a larger outline.")
    many = len(points) > 1
    least = float(np.asarray(cKDTree(points).query(points, 2)[0])[:, 1].min()) if many else float(wide.min())
    own = size * each
    return Standing(points - own @ points / own.sum(), own, least)


def _sides(fine: np.ndarray, lines: list[tuple[int, float]], least: float) -> np.ndarray:
    """Return which part (n,) of the section points (n, 2) are in; lines that leave one fewer than `least` do not count.

    A rod as thin as a sliver between a cut and the rim would be held by bonds that are far too stiff for its mass.
    """
    side = np.zeros(len(fine), int)
    for c, at in lines:
        divided = np.unique(2 * side + (fine[:, c] > at), return_inverse=True)[1]
        side = divided if np.bincount(divided).min() >= least else side
    return side


def _cells(fine: np.ndarray, rods: int, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the centroids (rods, 2) [m] of cells of one size, and how many of the points `fine` (n, 2) each has."""
    points = fine[generator.choice(len(fine), rods, replace=False)]
    for _ in range(_ROUNDS):
        owner = cKDTree(points).query(fine)[1]
        size = np.bincount(owner, minlength=rods)
        moved = np.column_stack([np.bincount(owner, fine[:, c], rods) for c in range(2)])
        points = np.where(size[:, None] > 0, moved / np.maximum(size, 1)[:, None], points)
    return points, np.bincount(cKDTree(points).query(fine)[1], minlength=rods)


def _kept(fine: np.ndarray, points: np.ndarray, size: np.ndarray, each: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (k, 2) moved so that rods have the second moments of their part `fine` (n, 2), and size (k,).

    Rods are round, their cells are not: of halves two rods high, whose cells are a third wider than high, they would be
    7 % too stiff where they stand at the centroids. each [m2]: what a point of `fine` stands for.
    """
    middle = fine.mean(0)
    wanted = np.cov(fine.T, bias=True) - np.eye(2) * float((size**2).sum()) * each / (4 * np.pi * len(fine))
    there = (points - middle).T @ ((points - middle) * size[:, None]) / size.sum()
    if min(*np.linalg.eigvalsh(there), *np.linalg.eigvalsh(wanted)) <= _FLAT * float(np.trace(there)):
        return points, size
    root = _root(there)
    # the symmetric map that takes the one to the other
    less = np.linalg.inv(root)
    return middle + (points - middle) @ (less @ _root(root @ wanted @ root) @ less), size


def _root(a: np.ndarray) -> np.ndarray:
    """Return the square root of a symmetric, positive matrix."""
    value, way = np.linalg.eigh(a)
    found: np.ndarray = (way * np.sqrt(value)) @ way.T
    return found
