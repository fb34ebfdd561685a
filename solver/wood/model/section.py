"""Where the rods stand in the section: two-stage Poisson sampling of a disk, and the area each rod carries.

Sutherland 2012, 3.3.1: points on the rim by a periodic one-dimensional Poisson sampling of angles, then points inside
that keep the same least distance from all others.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.spatial import cKDTree
from scipy.special import gammainc

__all__ = ["apart", "areas", "balanced", "place"]

#: Below this many rods there is no inside: they stand evenly on one ring.
_RING = 8
#: Points per squared least distance that Bridson's sampling leaves in the plane, measured.
_DENSITY = 0.70
_ATTEMPTS = 8
#: Points that are tried about each point.
_TRIED = 30
#: Quadrature points of the section per rod, for the cells' areas.
_PER_ROD, _FEWEST = 400, 20_000


def _rim(spacing: float, generator: np.random.Generator) -> np.ndarray:
    """Return angles in [0, 2 pi), neighbours `spacing` to 2 `spacing` apart, also across 2 pi."""
    angles = [float(generator.uniform(0, spacing))]
    while True:
        following = angles[-1] + float(generator.uniform(spacing, 2 * spacing))
        if following > 2 * np.pi + angles[0] - spacing:
            return np.array(angles)
        angles.append(following)


@njit(cache=True, error_model="numpy")
def _take(tried: np.ndarray, cells: np.ndarray, cell: float, least: float) -> np.ndarray:
    """Return which of the points tried (m, 2) are kept (m,), one after the other, and write them to cells (k, k, 2).

    cell: what a cell is wide; least: distance squared. Cells are single, so that two points are as far apart as these
    are; an empty one is NaN.
    """
    count = len(cells)
    kept = np.zeros(len(tried), np.bool_)
    for n in range(len(tried)):
        y, z = tried[n]
        if not (0.0 <= y <= 1.0 and 0.0 <= z <= 1.0):
            continue
        p, q = int(y / cell), int(z / cell)
        free = np.isnan(cells[p, q, 0])
        for i in range(max(p - 2, 0), min(p + 3, count)):
            for j in range(max(q - 2, 0), min(q + 3, count)):
                if (y - cells[i, j, 0]) ** 2 + (z - cells[i, j, 1]) ** 2 < least:
                    free = False
        if free:
            kept[n] = True
            cells[p, q, 0] = y
            cells[p, q, 1] = z
    return kept


def apart(least: float, generator: np.random.Generator) -> np.ndarray:
    """Return points (k, 2) that fill the unit square, at least `least` apart (Bridson 2007).

    They are those of `scipy.stats.qmc.PoissonDisk(2, radius=least).fill_space()`, digit for digit, which took most of
    the time that a bundle is laid in.
    """
    generator = generator.spawn(1)[0]
    cell = least / np.sqrt(2)
    count = int(np.ceil(1 / cell))
    cells = np.full((count, count, 2), np.nan, np.float32)
    pool = [generator.uniform(np.zeros(2), np.ones(2))]
    _take(pool[0][None], cells, cell, least**2)
    found = list(pool)
    while pool:
        middle = pool.pop(int(generator.integers(len(pool))))
        way = generator.standard_normal((_TRIED, 2))
        square = np.sum(way**2, axis=1)
        # evenly in the disk of twice the distance
        far = 2 * least * gammainc(1.0, square / 2) ** 0.5 / np.sqrt(square)
        tried = middle + way * far[:, None]
        fresh = tried[_take(tried, cells, cell, least**2)]
        pool.extend(fresh)
        found.extend(fresh)
    return np.array(found)


def _sample(mu: float, seed: int) -> np.ndarray:
    """Return the points (k, 2) of one sampling of the unit disk with the least distance `mu`."""
    generator = np.random.default_rng(seed)
    # a chord of length mu subtends a slightly larger angle than mu
    angles = _rim(2 * np.arcsin(min(mu / 2, 0.5)), generator)
    rim = np.column_stack([np.cos(angles), np.sin(angles)])
    inside = 2 * apart(mu / 2, generator) - 1
    inside = inside[np.hypot(*inside.T) < 1]
    far = cKDTree(rim).query(inside)[0] >= mu if len(inside) else np.zeros(0, bool)
    return np.concatenate([rim, inside[far]])


def place(rods: int, radius: float, generator: np.random.Generator) -> tuple[np.ndarray, float]:
    """Return points (k, 2) [m] in a disk of `radius` [m] and their least distance [m]; k is `rods` or close to it.

    The least distance is adjusted until the sampling gives the wanted number; the closest of several tries is kept.
    """
    if rods == 1:
        return np.zeros((1, 2)), radius
    if rods < _RING:
        angles = float(generator.uniform(0, 2 * np.pi)) + 2 * np.pi * np.arange(rods) / rods
        points = 2 / 3 * radius * np.column_stack([np.cos(angles), np.sin(angles)])
        return points, float(np.linalg.norm(points[0] - points[1]))
    seed = int(generator.integers(2**62))
    mu = float(np.sqrt(_DENSITY * np.pi / rods))
    best = found = _sample(mu, seed)
    least = mu
    for _ in range(_ATTEMPTS - 1):
        if abs(len(best) - rods) <= 0.01 * rods:
            break
        mu *= float(np.sqrt(len(found) / rods))
        found = _sample(mu, seed)
        if abs(len(found) - rods) < abs(len(best) - rods):
            best, least = found, mu
    return best * radius, least * radius


def areas(points: np.ndarray, radius: float) -> np.ndarray:
    """Return the area (k,) [m2] of each point's Voronoi cell within the disk; together exactly the disk's.

    Rods on the rim carry half a cell: with equal areas the section would be too stiff in bending.
    """
    count = max(_FEWEST, _PER_ROD * len(points))
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    rings = radius * np.sqrt((np.arange(count) + 0.5) / count)
    owner = cKDTree(points).query(np.column_stack([rings * np.cos(turn), rings * np.sin(turn)]))[1]
    return np.bincount(owner, minlength=len(points)) * (np.pi * radius**2 / count)


def balanced(points: np.ndarray, area: np.ndarray, radius: float) -> np.ndarray:
    """Return points (k, 2) [m] moved and scaled so that centroid and polar second moment are the disk's.

    Rods that stand on the rim of the sampling would make the section a fifth too stiff at 20 rods; scaled, their
    centres lie about their own radius below the surface.
    """
    centred: np.ndarray = points - area @ points / area.sum()
    spread = float(area @ (centred**2).sum(1))
    own = float((area**2).sum() / (2 * np.pi))
    if spread == 0:
        return centred
    found: np.ndarray = centred * np.sqrt(max(np.pi * radius**4 / 2 - own, 0.0) / spread)
    return found
