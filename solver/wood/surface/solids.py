"""The rigid bodies as meshes, so that whoever opens a result sees what pressed."""

from __future__ import annotations

import numpy as np

from ...meshes import Frame
from ..params import Body, WoodParams

__all__ = ["among", "solid"]

#: Sides of a cylinder.
_AROUND = 48
#: A box: its corners by the signs of x, y, z, each face counter-clockwise from outside.
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def _box(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    # faces have vertices of their own, so that edges are sharp
    first = 4 * np.arange(6)[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return (_SIGNS * np.array(size) / 2)[_FACES.ravel()], faces


def _cylinder(diameter: float, length: float, axis: int) -> tuple[np.ndarray, np.ndarray]:
    angle = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    ring = diameter / 2 * np.column_stack([0 * angle, np.cos(angle), np.sin(angle)])
    half = np.array([length / 2, 0.0, 0.0])
    points = np.concatenate([ring - half, ring + half, ring - half, ring + half])
    n = np.arange(_AROUND)
    m = (n + 1) % _AROUND
    side = np.concatenate([np.stack([n, n + _AROUND, m], 1), np.stack([m, n + _AROUND, m + _AROUND], 1)])[:, ::-1]
    fan = np.stack([0 * n[1:-1], n[1:-1], m[1:-1]], 1)
    # cyclic, so that no axis is mirrored
    return np.roll(points, axis, 1), np.concatenate([side, fan[:, ::-1] + 2 * _AROUND, fan + 3 * _AROUND])


def solid(body: Body, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) [m] and triangles (f, 3), seen from outside counter-clockwise, of a body at `time` [s]."""
    if body.shape == "box":
        points, faces = _box(body.size)
    else:
        points, faces = _cylinder(body.size[0], body.size[1], "xyz".index(body.axis))
    times = [w.time for w in body.path]
    return points + [np.interp(time, times, [w.position[c] for w in body.path]) for c in range(3)], faces


def among(frame: Frame, params: WoodParams, time: float) -> Frame:
    """Return the mesh of a moment with its bodies, whose vertices have the field `body` 1 and the others 0."""
    vertices, triangles, inside = [frame.vertices], [frame.triangles], [frame.fields["inside"]]
    count = len(frame.vertices)
    for body in params.bodies:
        points, faces = solid(body, time)
        vertices.append(points)
        triangles.append((faces + count).astype(frame.triangles.dtype))
        inside.append(np.zeros(len(points)))
        count += len(points)
    is_body = np.zeros(count)
    is_body[len(frame.vertices) :] = 1.0
    fields = {**frame.fields, "inside": np.concatenate(inside), "body": is_body}
    return Frame(np.concatenate(vertices), np.concatenate(triangles), fields)
