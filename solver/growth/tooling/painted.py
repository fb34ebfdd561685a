"""Tensors of growth that are painted by strokes and spread between them (the paper's 4.3).

Rates and directions are found on the shape at the tool's start. From then on they ride on the material: kept are the
directions' tensors, which have no sign that neighbours could disagree on, and the places where they were found, by
which each triangle carries its direction to what it has become.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from ...arrays import Floats, Ints
from ...contract import InvalidInput
from ..shapes import Ground
from .harmonic import harmonic_tensors
from .places import share
from .tools import HotTensors, PaintedStroke

__all__ = ["carried_ways", "laid_tensors", "logs_of"]

#: Columns: logarithmic rates; tensor of the first direction, upper triangle; place.
_LOGS, _WAYS, _PLACES = slice(0, 2), slice(2, 8), slice(8, 11)
_UPPER = np.triu_indices(3)
#: Distance between samples of a stroke, over the mean edge.
_FINE = 0.5


def laid_tensors(number: int, tool: HotTensors, ground: Ground, seed: int) -> Floats:
    """Return what rides on the vertices (n, 11) of a mesh with a tool's painted tensors, harmonic between its strokes.

    Raises:
        InvalidInput: a stroke without a direction where one is needed, a part of the surface without a stroke.

    """
    mesh = ground.mesh
    ways, rates = np.zeros_like(mesh.x), np.zeros((len(mesh.x), 2))
    painted = np.zeros(len(mesh.x), np.bool_)
    tree = KDTree(mesh.x)
    length = float(np.linalg.norm(mesh.x[mesh.triangles[:, 0]] - mesh.x[mesh.triangles[:, 1]], axis=1).mean())
    for k, stroke in enumerate(tool.strokes):
        under, along = _under(stroke, mesh.x, tree, _FINE * length)
        first, second = np.log(stroke.stretch)
        if first != second and not along.any(axis=1).all():
            raise InvalidInput(
                f"tool {number}: stroke {k} has no direction at {int((~along.any(axis=1)).sum())} of its vertices.",
                advice="Give it two points or more, a frame, or the same stretch both ways.",
            )
        painted[under], ways[under], rates[under] = True, along, (first, second)
    at = np.flatnonzero(painted)
    spread, found = harmonic_tensors(mesh.x, mesh.triangles, at, ways[at], rates[at])
    whole = share(tool.where, ground, seed)
    tensors = (found[:, :, None] * found[:, None, :])[:, *_UPPER]
    return np.concatenate([whole[:, None] * spread, tensors, mesh.x], axis=1)


def _under(stroke: PaintedStroke, x: Floats, tree: KDTree, fine: float) -> tuple[Ints, Floats]:
    """Return the vertices (m,) under a stroke, and directions (m, 3) of the first stretch there."""
    points = np.array(stroke.points)
    samples, ways = [points[:1]], [np.zeros((1, 3))]
    for tail, head in pairwise(points):
        count = int(np.linalg.norm(head - tail) / fine) + 2
        samples.append(tail + np.linspace(0, 1, count)[:, None] * (head - tail))
        ways.append(np.repeat((head - tail)[None], count, axis=0))
    places, along = np.concatenate(samples[min(len(points) - 1, 1) :]), np.concatenate(ways[min(len(points) - 1, 1) :])
    under = np.unique(tree.query(places)[1])
    if stroke.width:
        under = np.union1d(under, np.flatnonzero(KDTree(places).query(x)[0] <= stroke.width))
    if stroke.frame == "around":
        return under, np.stack([-x[under, 1], x[under, 0], np.zeros(len(under))], -1)
    if stroke.frame == "along":
        return under, along[KDTree(places).query(x[under])[1]]
    return under, np.broadcast_to(np.array(stroke.frame, float), (len(under), 3))


def logs_of(ridden: Floats) -> Floats:
    """Return the logarithmic rates (n, 2) of vertices."""
    return ridden[:, _LOGS]


def carried_ways(ridden: Floats, triangles: Ints) -> Floats:
    """Return the first directions of triangles (m, 3) as shares (m, 2) of their first and last edges from corner 0."""
    upper = ridden[triangles][:, :, _WAYS].mean(axis=1)
    tensor = np.empty((len(triangles), 3, 3))
    tensor[:, *_UPPER] = upper
    tensor[:, *_UPPER[::-1]] = upper
    p = ridden[triangles][:, :, _PLACES]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    size = np.maximum(np.linalg.norm(a, axis=1), 1e-300)
    first = a / size[:, None]
    lean = (first * b).sum(axis=1)
    other = b - lean[:, None] * first
    height = np.maximum(np.linalg.norm(other, axis=1), 1e-300)
    second = other / height[:, None]
    t11, t12, t22 = (
        np.einsum("mi,mij,mj->m", u, tensor, v) for u, v in ((first, first), (first, second), (second, second))
    )
    angle = np.arctan2(2 * t12, t11 - t22) / 2
    t = np.sin(angle) / height
    return np.stack([(np.cos(angle) - t * lean) / size, t], -1)
