"""Where the rods stand in the section: two-stage Poisson sampling of a disk, and the area each rod carries.

Sutherland 2012, 3.3.1: points on the rim by a periodic one-dimensional Poisson sampling of angles, then points inside
that keep the same least distance from all others.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import qmc

__all__ = ["areas", "balanced", "place"]

#: Below this many rods there is no inside: they stand evenly on one ring.
_RING = 8
#: Points per squared least distance that Bridson's sampling leaves in the plane, measured.
_DENSITY = 0.70
_ATTEMPTS = 8
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


def _sample(mu: float, seed: int) -> np.ndarray:
    """Return the points (k, 2) of one sampling of the unit disk with the least distance `mu`."""
    generator = np.random.default_rng(seed)
    # a chord of length mu subtends a slightly larger angle than mu
    angles = _rim(2 * np.arcsin(min(mu / 2, 0.5)), generator)
    rim = np.column_stack([np.cos(angles), np.sin(angles)])
    inside = 2 * qmc.PoissonDisk(2, radius=mu / 2, rng=generator).fill_space() - 1
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
    best = _sample(mu, seed)
    least = mu
    for _ in range(_ATTEMPTS):
        if abs(len(best) - rods) <= 0.01 * rods:
            break
        found = _sample(mu, seed)
        if abs(len(found) - rods) < abs(len(best) - rods):
            best, least = found, mu
        mu *= float(np.sqrt(len(found) / rods))
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
