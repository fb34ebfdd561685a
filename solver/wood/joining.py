"""Bonds between the rods of a bundle as laid, and the rigid bodies about it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..contract import InvalidGeometry
from .arrays import Bodies, Bonds
from .grain import Field
from .params import WoodParams

__all__ = ["bodied", "bonded"]

#: The transverse spring of a bond over transverse modulus and volume: an isotropic planar net of springs of energy
#: density c eps_n^2 / 2 has the Young's modulus c / 3.
_NET = 3.0


def bodied(params: WoodParams, k: float, ease: float) -> Bodies:
    """Return the bodies with contact stiffness k [N/m], gained over the depth `ease` [m]."""
    found, width = params.bodies, max((len(b.path) for b in params.bodies), default=1)
    times = np.zeros((len(found), width))
    points = np.zeros((len(found), width, 3))
    half = np.zeros((len(found), 3))
    for r, body in enumerate(found):
        count = len(body.path)
        times[r, :count] = [w.time for w in body.path]
        # never reached: the body rests at its last place
        times[r, count:] = np.inf
        points[r, :count] = [w.position for w in body.path]
        points[r, count:] = points[r, count - 1]
        half[r] = np.array(body.size) / 2
        if body.shape == "cylinder":
            half[r, 2] = 0.0
    return Bodies(
        np.array([b.shape == "cylinder" for b in found], np.int32),
        np.array(["xyz".index(b.axis) for b in found], np.int32),
        half,
        np.array([b.friction for b in found], float),
        times,
        points,
        np.full(len(found), k),
        np.full(len(found), ease),
    )


def bonded(
    params: WoodParams,
    points: np.ndarray,
    s: np.ndarray,
    grid: np.ndarray,
    edge: np.ndarray,
    rest: np.ndarray,
    grain: Field,
    strong: Field,
) -> Bonds:
    """Bond every vertex to the closest point of each rod within reach.

    points (k, 2) in the section, s (k, n) places along, grid (k, n) vertex numbers, edge (k, n - 1) edge numbers,
    rest (v, 3) places at rest.
    """
    near = params.reach * float(np.sqrt(np.pi * params.radius**2 / len(points)))
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T)] if len(pairs) else np.zeros((0, 2), int)
    vertex, on, share = [np.zeros(0, np.int32)], [np.zeros(0, np.int32)], [np.zeros(0)]
    n = s.shape[1]
    for p, q in np.concatenate([pairs, pairs[:, ::-1]]):
        # rods are parallel at rest: the closest point lies at the same place along
        j = np.clip(np.searchsorted(s[q], s[p]) - 1, 0, n - 2)
        vertex.append(grid[p])
        on.append(edge[q][j])
        share.append(np.clip((s[p] - s[q][j]) / (s[q][j + 1] - s[q][j]), 0, 1))
    i, e, u = np.concatenate(vertex), np.concatenate(on), np.concatenate(share)
    width = (np.searchsorted(edge[:, 0], e, side="right") - 1).astype(int)
    first = grid[width, e - edge[width, 0]]
    a, b = rest[first], rest[first + 1]
    d = rest[i] - (1 - u[:, None]) * a - u[:, None] * b
    length = np.linalg.norm(d, axis=1)
    if len(i) and not length.min() > 0:
        raise InvalidGeometry("two rods stand at the same place.", advice="Take fewer rods or a wider bundle.")
    cosine = ((b - a) * d).sum(1) / np.maximum(np.linalg.norm(b - a, axis=1) * length, 1e-300)
    volume = np.pi * params.radius**2 * params.length / max(len(i), 1)
    middle = rest[i] - d / 2
    stiff = grain.factor(middle, params.grain.stiffness)
    strength = strong.factor(middle, params.grain.strength)
    return Bonds(
        i.astype(np.int32),
        e.astype(np.int32),
        u,
        length,
        _NET * params.transverse * volume / np.maximum(length, 1e-300) * stiff,
        params.shear * volume * stiff,
        cosine,
        params.bond_energy * volume * strength**2,
        np.ones(len(i), np.uint8),
    )
