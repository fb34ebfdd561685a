"""Where vertices lie along the rods, the shape of the unloaded bundle, and the shape it starts with."""

from __future__ import annotations

import numpy as np

from ..params import WoodParams
from ..shape.curve import Curve
from ..shape.fork import forked

__all__ = ["along", "curved", "laid", "started"]


def along(rods: int, vertices: int, params: WoodParams, generator: np.random.Generator) -> np.ndarray:
    """Return the vertices' places (rods, vertices) [m] along the rods, edges within their least and greatest length."""
    u = params.unevenness
    if u == 0 or vertices == 3:
        return np.tile(np.linspace(0, params.length, vertices), (rods, 1))
    # edges of mean 1 whose scaling to the full length keeps them within 1 - u and 1 + u
    edges = 1 + u * generator.uniform(-1, 1, (rods, vertices - 1))
    edges = 1 + (edges - edges.mean(1, keepdims=True)) * (1 - 1 / (vertices - 1))
    edges = np.clip(edges, 1 - u, 1 + u)
    edges /= edges.sum(1, keepdims=True)
    places = np.zeros((rods, vertices))
    places[:, 1:] = np.cumsum(edges, 1) * params.length
    places[:, -1] = params.length
    return places


def curved(straight: np.ndarray, curvature: float) -> np.ndarray:
    """Return points (..., 3) of the straight bundle bent to an arc in the x-z plane, towards +z.

    Before its start at x = 0 it goes straight on: a clamp has the direction of the arc there, not of a chord.
    """
    if curvature == 0:
        return straight.copy()
    s, y, z = np.moveaxis(straight, -1, 0)
    r = 1 / curvature
    s, before = np.maximum(s, 0.0), np.minimum(s, 0.0)
    return np.stack([(r - z) * np.sin(s / r) + before, y, r - (r - z) * np.cos(s / r)], -1)


def laid(straight: np.ndarray, names: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return points (k, n, 3) [m] of the straight bundle where they are unloaded; names (k, 2) [m] of rods."""
    if params.fork is not None:
        return forked(straight, names, params)
    if params.spine:
        return Curve(params.spine).laid(straight)
    return curved(straight, params.curvature)


def started(rest: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return the points (..., 3) at time 0: the rest shape, deflected by `bend`."""
    x = rest.copy()
    if params.bend:
        xi = rest[..., 0] / params.length
        inside = np.clip(xi, 0, 1)
        shape, slope = {
            "none": (np.sin(np.pi * xi) - 2 / np.pi, np.pi * np.cos(np.pi * xi)),
            "start": (inside**2 * (3 - inside) / 2, inside * (6 - 3 * inside) / 2),
            "both": ((1 - np.cos(2 * np.pi * inside)) / 2, np.pi * np.sin(2 * np.pi * inside)),
        }[params.clamp]
        x[..., 2] += params.bend * params.length * shape
        # sections stay plane and square to the axis; without it the bonds would start sheared
        x[..., 0] -= params.bend * rest[..., 2] * slope
    return x
