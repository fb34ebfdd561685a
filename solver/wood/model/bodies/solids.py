"""Bodies as closed meshes in their own frames, about their centres: what is drawn, weighed, and sampled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...bodies import Body, half_width

__all__ = ["Weight", "pivot_of", "solid_of", "weight_of"]

#: Sides of a cylinder; rings and meridians of a ball; sides of a wedge's rounded edge.
_AROUND, _RINGS, _ROUND = 48, 24, 12
#: A box: its corners by the signs of x, y, z, each face counter-clockwise from outside.
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])

Mesh = tuple[np.ndarray, np.ndarray]


class Weight(NamedTuple):
    """Volume [m3], middle (3,) [m], and inertia (3, 3) about it over density [m5], of a solid of even density."""

    volume: float
    middle: np.ndarray
    inertia: np.ndarray


def _box(size: tuple[float, float, float]) -> Mesh:
    # faces have vertices of their own, so that edges are sharp
    first = 4 * np.arange(6)[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return (_SIGNS * np.array(size) / 2)[_FACES.ravel()], faces


def _prism(ring: np.ndarray, half: float, smooth: bool) -> Mesh:
    """Return a prism along x over a convex outline (n, 3) at x = 0, counter-clockwise seen from +x."""
    shift, n = np.array([half, 0.0, 0.0]), np.arange(len(ring))
    m = (n + 1) % len(ring)
    fan = np.stack([0 * n[1:-1], n[1:-1], m[1:-1]], 1)
    if smooth:
        wall = np.concatenate([ring - shift, ring + shift])
        low, high = len(ring) + n, len(ring) + m
        side = np.concatenate([np.stack([n, low, m], 1), np.stack([m, low, high], 1)])[:, ::-1]
    else:
        wall = np.stack([ring - shift, ring[m] - shift, ring[m] + shift, ring + shift], 1).reshape(-1, 3)
        first = 4 * n[:, None]
        side = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    ends = np.concatenate([ring - shift, ring + shift])
    faces = np.concatenate([side, fan[:, ::-1] + len(wall), fan + len(wall) + len(ring)])
    return np.concatenate([wall, ends]), faces


def _cylinder(diameter: float, length: float, axis: int) -> Mesh:
    angle = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    ring = diameter / 2 * np.column_stack([0 * angle, np.cos(angle), np.sin(angle)])
    points, faces = _prism(ring, length / 2, smooth=True)
    # cyclic, so that no axis is mirrored
    return np.roll(points, axis, 1), faces


def _ball(diameter: float) -> Mesh:
    polar = np.linspace(0, np.pi, _RINGS + 1)[1:-1]
    angle = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    flat = np.stack([np.outer(np.sin(polar), np.cos(angle)), np.outer(np.sin(polar), np.sin(angle))], -1)
    height = np.repeat(np.cos(polar)[:, None, None], _AROUND, 1)
    points = np.concatenate([np.concatenate([flat, height], -1).reshape(-1, 3), [[0, 0, 1.0], [0, 0, -1.0]]])
    n = np.arange(_AROUND)
    m = (n + 1) % _AROUND
    top, low = len(points) - 2, (_RINGS - 2) * _AROUND
    faces = [np.stack([0 * n + top, n, m], 1), np.stack([0 * n + top + 1, low + m, low + n], 1)]
    for ring in range(_RINGS - 2):
        a = ring * _AROUND
        b = a + _AROUND
        faces += [np.stack([a + n, b + n, b + m], 1), np.stack([a + n, b + m, a + m], 1)]
    return points * diameter / 2, np.concatenate(faces)


def _wedge(body: Body) -> Mesh:
    half, height, sine, cosine = thickness(body) / 2, body.size[2], np.sin(body.angle / 2), np.cos(body.angle / 2)
    angles = np.linspace(-1, 1, _ROUND + 1) * (np.pi - body.angle) / 2
    outline = [body.edge * np.column_stack([np.sin(angles), 1 - np.cos(angles)])]
    # where a blade's bevel meets its flank
    knee = body.edge + (half * cosine - body.edge) / sine
    blade = knee < height * (1 - 1e-9)
    outline += [np.array([[half, knee]])] if blade else []
    outline += [np.array([[half, height], [-half, height]])]
    outline += [np.array([[-half, knee]])] if blade else []
    x, z = np.concatenate(outline).T
    # the prism's x, y, z are the wedge's y, z, x: seen from there it goes round the other way
    points, faces = _prism(np.column_stack([0 * x, z - height / 2, x])[::-1], body.size[1] / 2, smooth=False)
    return np.roll(points, 1, 1), faces


def thickness(body: Body) -> float:
    """Return the thickness [m] of a wedge."""
    return body.size[0] or 2 * half_width(body.size[2], body.angle, body.edge)


def _boxed(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle and the half sides (3,) [m] of the box about a mesh's points."""
    assert body.mesh is not None
    points = np.array(body.mesh.points)
    low, high = points.min(0), points.max(0)
    return (low + high) / 2, (high - low) / 2


def solid_of(body: Body) -> Mesh:
    """Return vertices (v, 3) [m] from its centre and triangles (f, 3), seen from outside counter-clockwise."""
    if body.shape == "box":
        return _box(body.size)
    if body.shape == "cylinder":
        return _cylinder(body.size[0], body.size[1], "xyz".index(body.axis))
    if body.shape == "ball":
        return _ball(body.size[0])
    if body.shape == "wedge":
        return _wedge(body)
    assert body.mesh is not None
    return np.array(body.mesh.points) - _boxed(body)[0], np.array(body.mesh.faces)


def pivot_of(body: Body) -> np.ndarray:
    """Return the place (3,) [m] from its centre that the path tells of, in its own frame."""
    if body.shape == "wedge" and body.pivot is None:
        return np.array([0.0, 0.0, -body.size[2] / 2])
    own = np.array(body.pivot if body.pivot is not None else (0.0, 0.0, 0.0))
    return own - _boxed(body)[0] if body.shape == "mesh" else own


def weight_of(body: Body) -> Weight:
    """Return what a body of even density weighs: of box, cylinder and ball exactly, else of its mesh."""
    a, b, c = body.size
    if body.shape == "box":
        volume, square = a * b * c, np.array([b * b + c * c, a * a + c * c, a * a + b * b]) / 12
        return Weight(volume, np.zeros(3), volume * np.diag(square))
    if body.shape == "ball":
        volume = np.pi * a**3 / 6
        return Weight(volume, np.zeros(3), volume * a * a / 10 * np.eye(3))
    if body.shape == "cylinder":
        volume = np.pi * a * a / 4 * b
        square = np.full(3, a * a / 16 + b * b / 12)
        square["xyz".index(body.axis)] = a * a / 8
        return Weight(volume, np.zeros(3), volume * np.diag(square))
    points, faces = solid_of(body)
    corners = points[faces]
    # tetrahedra from the origin: volumes by sign, and second moments by their corners and their sum
    six = np.linalg.det(corners)
    volume = float(six.sum()) / 6
    total = corners.sum(1)
    middle = np.einsum("f,fi->i", six, total) / 24 / volume
    second = np.einsum("f,fki,fkj->ij", six, corners, corners) + np.einsum("f,fi,fj->ij", six, total, total)
    about = second / 120 - volume * np.outer(middle, middle)
    return Weight(volume, middle, np.trace(about) * np.eye(3) - about)
