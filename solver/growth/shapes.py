"""Start shapes, in units of their own size, flat ones here; solids of revolution are `revolved`."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, Delaunay

from ..arrays import Floats, Ints
from . import revolved

__all__ = ["Ground", "Mesh", "Shape", "is_closed", "start"]

Shape = Literal[
    "sphere", "disc", "half_disc", "strip", "square", "triangle", "tube", "stem", "capsule", "cone", "torus"
]


class Mesh(NamedTuple):
    """Points (n, 3), triangles (f, 3) counter-clockwise from outside or from above (z)."""

    x: Floats
    triangles: Ints


class Ground(NamedTuple):
    """What shares are found on: a mesh, the vertices of its edge (b,), and its texture coordinates if it has some.

    uv: (f, 3, 2) of the triangles' corners, v upwards [1].
    """

    mesh: Mesh
    border: Ints
    uv: Floats | None = None


def is_closed(triangles: Ints) -> bool:
    """Return whether a surface has no rim: every edge has two triangles."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def start(shape: Shape, vertices: int, aspect: float) -> Mesh:
    """Return a start shape of about `vertices` points.

    Sphere, disc and half-disc have radius 1; strip (along x) and square width 1; the tube (about z, standing on z = 0)
    radius 1. aspect: length over width of the strip, height over radius of the tube. The triangle has a base of width 1
    at x = -aspect / 2 and its tip at aspect / 2; stem, capsule, cone and torus are in `revolved`, `aspect` being
    their height, length, height, and the torus' radius over its tube's.
    """
    if shape in ("stem", "capsule", "cone", "torus"):
        return _ordered(*getattr(revolved, shape)(vertices, aspect))
    if shape == "triangle":
        return _triangle(vertices, aspect)
    if shape == "sphere":
        return _sphere(vertices)
    if shape in ("disc", "half_disc"):
        return _disc(vertices, half=shape == "half_disc")
    if shape == "tube":
        return _tube(vertices, aspect)
    return _sheet(vertices, aspect if shape == "strip" else 1.0)


def _sphere(count: int) -> Mesh:
    """Return a geodesic sphere: an icosahedron whose edges are cut in m parts, 10 m^2 + 2 points."""
    m = max(2, round(np.sqrt((count - 2) / 10)))
    phi = (1 + 5**0.5) / 2
    corners = np.array([[0, s, t * phi] for s in (-1, 1) for t in (-1, 1)], float)
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    # one corner on the z axis
    axis = corners[0] / np.linalg.norm(corners[0])
    side = np.cross(axis, [1.0, 0, 0])
    side /= np.linalg.norm(side)
    corners = corners @ np.stack([side, np.cross(axis, side), axis], -1)
    found = []
    for a, b, c in corners[ConvexHull(corners).simplices]:
        i, j = np.meshgrid(np.arange(m + 1), np.arange(m + 1), indexing="ij")
        i, j = i[i + j <= m], j[i + j <= m]
        found.append((a * (m - i - j)[:, None] + b * i[:, None] + c * j[:, None]) / m)
    points = np.concatenate(found)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    _, first = np.unique(np.round(points, 9), axis=0, return_index=True)
    points = points[np.sort(first)]
    triangles = ConvexHull(points).simplices.astype(np.int64)
    p = points[triangles]
    inward = np.einsum("fi,fi->f", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p.sum(1)) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return _ordered(points, triangles)


def _disc(count: int, half: bool) -> Mesh:
    """Return a lattice cut to a disc, with points along the rim."""
    area = np.pi / (2 if half else 1)
    h = np.sqrt(area / (count * np.sqrt(0.75)))
    reach = int(1 / h) + 2
    i, j = np.meshgrid(np.arange(-2 * reach, 2 * reach + 1), np.arange(-2 * reach, 2 * reach + 1))
    plane = np.stack([(i + 0.5 * j) * h, j * h * np.sqrt(0.75)], -1).reshape(-1, 2)
    around = np.linspace(0, np.pi if half else 2 * np.pi, int((np.pi if half else 2 * np.pi) / h), endpoint=half)
    rim = np.stack([np.cos(around), np.sin(around)], -1)
    keep = np.hypot(*plane.T) < 1 - 0.45 * h
    if half:
        keep &= plane[:, 1] > 0.45 * h
        base = np.linspace(-1, 1, int(2 / h))[1:-1]
        rim = np.concatenate([rim, np.stack([base, 0 * base], -1)])
    return _flat(np.concatenate([plane[keep], rim]), h)


def _sheet(count: int, aspect: float) -> Mesh:
    h = np.sqrt(aspect / (count * np.sqrt(0.75)))
    rows, columns = max(3, round(1 / (h * np.sqrt(0.75)))) + 1, max(3, round(aspect / h)) + 1
    x, y = np.meshgrid(np.linspace(-aspect / 2, aspect / 2, columns), np.linspace(-0.5, 0.5, rows))
    shift = np.where(np.arange(rows) % 2 == 0, 0.25, -0.25)[:, None] * aspect / (columns - 1)
    shift = np.where((np.arange(columns) == 0) | (np.arange(columns) == columns - 1), 0.0, shift)
    return _flat(np.stack([x + shift, y], -1).reshape(-1, 2), h)


def _triangle(count: int, aspect: float) -> Mesh:
    """Return a lattice cut to a triangle with a base of 1 and a height, with points along its sides."""
    h = np.sqrt(aspect / 2 / (count * np.sqrt(0.75)))
    tip, base = np.array([aspect / 2, 0.0]), np.array([[-aspect / 2, -0.5], [-aspect / 2, 0.5]])
    corners = np.array([base[0], tip, base[1]])
    reach = int(max(aspect, 1) / h) + 2
    i, j = np.meshgrid(np.arange(-2 * reach, 2 * reach + 1), np.arange(-2 * reach, 2 * reach + 1))
    plane = np.stack([(i + 0.5 * j) * h, j * h * np.sqrt(0.75)], -1).reshape(-1, 2)
    inside, sides = np.ones(len(plane), bool), []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = b - a
        size = float(np.linalg.norm(way))
        inside &= (way[0] * (plane[:, 1] - a[1]) - way[1] * (plane[:, 0] - a[0])) / size > 0.45 * h
        sides.append(a + np.linspace(0, 1, max(1, round(size / h)), endpoint=False)[:, None] * way)
    return _flat(np.concatenate([plane[inside], *sides]), h)


def _flat(plane: Floats, h: float) -> Mesh:
    triangles = Delaunay(plane).simplices.astype(np.int64)
    p = plane[triangles]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    # the hull of a rounded rim has slivers of rounding size
    triangles = triangles[np.abs(area) > 1e-3 * h * h]
    return _ordered(np.column_stack([plane, np.zeros(len(plane))]), triangles)


def _tube(count: int, aspect: float) -> Mesh:
    h = np.sqrt(2 * np.pi * aspect / (count * np.sqrt(0.75)))
    rows, columns = max(2, round(aspect / (h * np.sqrt(0.75)))) + 1, max(6, round(2 * np.pi / h))
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    around = 2 * np.pi * (i + 0.5 * (j % 2)) / columns
    points = np.stack([np.cos(around), np.sin(around), aspect * j / (rows - 1)], -1).reshape(-1, 3)
    low, east = (i + columns * j)[:-1], ((i + 1) % columns + columns * j)[:-1]
    high, far = low + columns, east + columns
    even = (j[:-1] % 2 == 0)[..., None]
    one = np.where(even, np.stack([low, east, high], -1), np.stack([low, east, far], -1))
    two = np.where(even, np.stack([east, far, high], -1), np.stack([low, far, high], -1))
    return _ordered(points, np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)]))


def _ordered(x: Floats, triangles: Ints) -> Mesh:
    """Sort triangles by their lowest vertex, so that neighbours in space are neighbours in memory."""
    used = np.unique(triangles)
    number = np.full(len(x), -1)
    number[used] = np.arange(len(used))
    triangles = number[triangles]
    return Mesh(x[used], np.ascontiguousarray(triangles[np.argsort(triangles.min(axis=1), kind="stable")]))
