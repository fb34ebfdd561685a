"""Tetrahedra as a medium: what flows along their edges, what volume each point stands for, and where a place lies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from ..arrays import Array, Floats, Ints

__all__ = ["Edges", "edges", "within"]

#: Nearest tetrahedra, by their middles, among which the one that holds a place is looked for: at first, and at last.
_CANDIDATES = (12, 96)


class Edges(NamedTuple):
    """Edges (e, 2) of tetrahedra, the lower number first; weight (e): what flows for a difference of 1 in a medium of
    diffusivity 1 (linear elements: minus the stiffness); volume (p) of each point, a quarter of its tetrahedra's.
    """

    ends: Ints
    weight: Floats
    volume: Floats


def edges(points: Floats, tets: Ints) -> Edges:
    """Return the edges of tetrahedra (t, 4) of positive volume between points (p, 3)."""
    sides = points[tets[:, 1:]] - points[tets[:, :1]]
    slopes = np.swapaxes(np.linalg.inv(sides), 1, 2)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    volume = np.abs(np.linalg.det(sides)) / 6
    keys, flows, count = [], [], len(points)
    for i in range(4):
        for j in range(i + 1, 4):
            keys.append(np.minimum(tets[:, i], tets[:, j]) * count + np.maximum(tets[:, i], tets[:, j]))
            flows.append(-volume * (slopes[:, i] * slopes[:, j]).sum(axis=1))
    found, back = np.unique(np.concatenate(keys), return_inverse=True)
    weight = np.bincount(back, np.concatenate(flows)).astype(float)
    shared = np.bincount(tets.ravel(), np.repeat(volume / 4, 4), count)
    return Edges(np.stack([found // count, found % count], axis=1), weight, shared.astype(float))


def within(points: Array, tets: Array, wanted: Array) -> sparse.csr_array:
    """Return the matrix (w rows) that takes a field of tetrahedra's points (p) linearly to wanted places (w, 3).

    A place outside of all of them gets a mean of the corners of one near by.
    """
    corners, wanted = np.asarray(points, float)[tets], np.asarray(wanted, float)
    sides = corners[:, 1:] - corners[:, :1]
    # those that are flat hold no place
    flat = np.abs(np.linalg.det(sides)) <= 1e-12 * np.linalg.norm(sides, axis=2).max(axis=1) ** 3
    inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(3), sides))
    tree = KDTree(corners.mean(axis=1))
    best, shares = np.full(len(wanted), -np.inf), np.zeros((len(wanted), 4))
    cell = np.zeros(len(wanted), np.int64)
    for most in _CANDIDATES:
        left = np.flatnonzero(best < -1e-9)
        if not len(left):
            break
        _, near = tree.query(wanted[left], k=min(most, len(tets)))
        for column in np.asarray(near).reshape(len(left), -1).T:
            along = ((wanted[left] - corners[column, 0])[:, None, :] * np.swapaxes(inverse[column], 1, 2)).sum(axis=2)
            found = np.concatenate([1 - along.sum(axis=1, keepdims=True), along], axis=1)
            inside = np.where(flat[column], -np.inf, found.min(axis=1))
            better = inside > best[left]
            here = left[better]
            best[here], shares[here], cell[here] = inside[better], found[better], column[better]
    shares = np.clip(shares, 0, None)
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-300)
    index = (np.repeat(np.arange(len(wanted)), 4), np.asarray(tets)[cell].ravel())
    return sparse.csr_array((shares.ravel(), index), shape=(len(wanted), len(points)))
