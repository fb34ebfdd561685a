"""Triangles in the plane, as the rest metrics of a shell lay them out."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats

__all__ = ["angle", "cross", "metric"]


def cross(u: Floats, v: Floats) -> Floats:
    """Return the cross products (m,) of vectors (m, 2)."""
    found: Floats = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return found


def angle(at: Floats, p: Floats, q: Floats) -> Floats:
    """Return the angles (m,) between p and q as seen from `at`, points (m, 2)."""
    u, v = p - at, q - at
    found: Floats = np.abs(np.arctan2(cross(u, v), (u * v).sum(-1)))
    return found


def metric(p: Floats, q: Floats, r: Floats) -> Floats:
    """Return the metrics (m, 3) of triangles from their corners (m, 2): products of the edges from p to q and to r."""
    u, v = q - p, r - p
    return np.stack([(u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)], -1)
