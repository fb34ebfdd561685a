"""A small software renderer for surfaces of triangles: no window, no GPU, only numpy.

Lattices are resampled through their spectrum, other triangles are cut in four until they cover few pixels. Then every
triangle tests the few pixels of its bounding box, all triangles at a time, and the nearest fragment wins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from store import spectra

__all__ = ["BACKGROUND", "View", "mesh", "render", "render_triangles"]

Array = NDArray[Any]

#: Paper-white behind the fruits; linear light, 0 to 1.
BACKGROUND = np.array([0.93, 0.91, 0.88])

#: Colours of a dried jujube: on the ridges, and in the depth of the wrinkles.
_RIDGE = np.array([0.53, 0.105, 0.05])
_VALLEY = np.array([0.13, 0.016, 0.014])

#: Directions towards the lights in the camera's frame (right, up, towards the eye), and their colours.
_KEY = np.array([-0.62, 0.62, 0.48])
_FILL = np.array([0.85, 0.10, 0.52])
_TO_EYE = np.array([0.0, 0.0, 1.0])
_KEY_COLOUR = np.array([1.25, 1.18, 1.08])
_FILL_COLOUR = np.array([0.20, 0.24, 0.32])
_AMBIENT = np.array([0.20, 0.19, 0.19])

_SUPERSAMPLES = 2
#: Resolution at which surfaces are drawn: one lattice cell of it covers about a pixel of a large picture.
_FINEST = 256
#: Longest side of a triangle's box when it is drawn [sub-pixels]; and the colour of surfaces that have none.
_COARSEST = 16
_CLAY = np.array([0.42, 0.50, 0.20])


@dataclass(frozen=True)
class View:
    """Where the camera stands [degree] and how much it sees: `extent` [r1] from the middle to the picture's edge."""

    azimuth: float = 35.0
    elevation: float = 22.0
    extent: float = 1.15


def mesh(position: Array, poles: Array | None = None, resolution: int | None = None) -> tuple[Array, Array]:
    """Return (vertices (v, 3), triangles (t, 3), wound outwards) of a surface (n, 2n, 3), resampled if asked for.

    Missing poles, and those of a resampled surface, come from its spectrum.
    """
    if poles is None or (resolution is not None and resolution != len(position)):
        waves = spectra.spectrum(position)
        poles = spectra.poles(waves)
        if resolution is not None:
            position = spectra.synthesize(waves, resolution)
    n, m = position.shape[:2]
    vertices = np.concatenate([position.reshape(-1, 3), poles]).astype(float)
    here = np.arange(n * m).reshape(n, m)
    east = np.roll(here, -1, axis=1)
    a, b, c, d = here[:-1], east[:-1], here[1:], east[1:]
    north, south = np.full(m, n * m), np.full(m, n * m + 1)
    faces = [
        np.stack([a, b, d], -1).reshape(-1, 3),
        np.stack([a, d, c], -1).reshape(-1, 3),
        np.stack([north, east[0], here[0]], -1),
        np.stack([south, here[-1], east[-1]], -1),
    ]
    return vertices, np.concatenate(faces)


def render(
    position: Array,
    poles: Array | None = None,
    pixels: int = 320,
    view: View | None = None,
    colour: Array | None = None,
) -> Array:
    """Return a picture (pixels, pixels, 3), uint8, of a surface (n, 2n, 3) [r1].

    colour: (n, 2n, 3) of the same lattice, linear light, in place of a dried jujube's.
    """
    view = view or View()
    side = pixels * _SUPERSAMPLES
    resolution = int(np.clip(side // 3, len(position), max(_FINEST, len(position))))
    vertices, faces = mesh(position, poles, resolution)
    paint = None if colour is None else _paint(colour, resolution)
    return _draw(vertices, faces, paint, pixels, view, _frame(view), open_=False)


def render_triangles(
    vertices: Array,
    triangles: Array,
    pixels: int = 320,
    view: View | None = None,
    colour: Array | None = None,
    up: str = "y",
) -> Array:
    """Return a picture (pixels, pixels, 3), uint8, of vertices (v, 3) and triangles (f, 3), seen from both sides.

    The view's middle is the origin. colour: (v, 3), linear light; up: the axis that points up, y or z.
    """
    view = view or View()
    frame = _frame(view)
    if up == "z":
        frame = frame[:, [2, 0, 1]]
    paint = np.broadcast_to(_CLAY, np.shape(vertices)) if colour is None else colour
    return _draw(np.asarray(vertices, float), np.asarray(triangles, np.int64), paint, pixels, view, frame, open_=True)


def _draw(
    vertices: Array, faces: Array, paint: Array | None, pixels: int, view: View, frame: Array, open_: bool
) -> Array:
    side = pixels * _SUPERSAMPLES
    scale = side / 2 / view.extent
    normals = _normals(vertices, faces)
    if open_:
        values = np.concatenate([vertices, normals, np.asarray(paint, float)], axis=1)
        values, faces = _finer(values, faces, _COARSEST / scale)
        vertices, normals, paint = values[:, :3], values[:, 3:6], values[:, 6:]
    seen, turned = vertices @ frame.T, normals @ frame.T
    points = np.stack([side / 2 + scale * seen[:, 0], side / 2 - scale * seen[:, 1]], axis=-1)
    index, face, weights, back = _rasterise(points, seen[:, 2], faces, side, open_)
    corners = faces[face]
    depth = np.full(side * side, -np.inf)
    depth[index] = np.einsum("fk,fk->f", weights, seen[corners, 2])
    normal = np.einsum("fk,fkc->fc", weights, turned[corners])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    normal[back] *= -1
    image = _floor_shadow(side, view, seen, scale)
    skin = None if paint is None else np.einsum("fk,fkc->fc", weights, paint[corners])
    image.reshape(-1, 3)[index] = _shade(normal, _relief(depth.reshape(side, side)).ravel()[index], skin)
    small = image.reshape(pixels, _SUPERSAMPLES, pixels, _SUPERSAMPLES, 3).mean(axis=(1, 3))
    return (255 * np.clip(small, 0, 1) ** (1 / 2.2) + 0.5).astype(np.uint8)


def _finer(values: Array, faces: Array, longest: float) -> tuple[Array, Array]:
    """Cut triangles with an edge above `longest` in four, until there are none; values (v, k) begin with places."""
    done = []
    while True:
        p = values[faces, :3]
        long = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1) > longest
        done.append(faces[~long])
        if not long.any() or len(values) > 4_000_000:
            return values, np.concatenate([*done, faces[long]])
        a, b, c = faces[long].T
        middles = [0.5 * (values[i] + values[j]) for i, j in ((a, b), (b, c), (c, a))]
        ab, bc, ca = (len(values) + k * len(a) + np.arange(len(a)) for k in range(3))
        values = np.concatenate([values, *middles])
        faces = np.concatenate([np.stack(t, -1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def _frame(view: View) -> Array:
    """Return the camera's axes as rows: right, up, towards the eye. The world's y axis is up."""
    turn, tilt = np.radians([view.azimuth, view.elevation])
    eye = np.array([np.cos(tilt) * np.cos(turn), np.sin(tilt), np.cos(tilt) * np.sin(turn)])
    right = np.array([np.sin(turn), 0.0, -np.cos(turn)])
    return np.stack([right, np.cross(eye, right), eye])


def _normals(vertices: Array, faces: Array) -> Array:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(faces[:, corner], areas[:, axis], len(vertices))
    return total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-300)


def _rasterise(
    points: Array, depth: Array, faces: Array, side: int, both: bool
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return (pixel index, face, barycentric weights, seen from behind) of what is nearest to the eye in each pixel.

    both: triangles that turn away from the eye are drawn too.
    """
    corners = points[faces]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0]
    # the picture's second axis points down
    front = np.flatnonzero(np.abs(area) > 1e-12) if both else np.flatnonzero(area < -1e-12)
    behind = area > 0
    corners, edge1, edge2, area = corners[front], edge1[front], edge2[front], area[front]
    low = np.floor(corners.min(axis=1)).astype(int)
    span = np.ceil(corners.max(axis=1)).astype(int) - low
    found = []
    for dy in range(int(span[:, 1].max(initial=0)) + 1):
        for dx in range(int(span[:, 0].max(initial=0)) + 1):
            near = np.flatnonzero((span[:, 0] >= dx) & (span[:, 1] >= dy))
            pixel = low[near] + [dx, dy]
            offset = pixel + 0.5 - corners[near, 0]
            u = (offset[:, 0] * edge2[near, 1] - offset[:, 1] * edge2[near, 0]) / area[near]
            v = (edge1[near, 0] * offset[:, 1] - edge1[near, 1] * offset[:, 0]) / area[near]
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & ((pixel >= 0) & (pixel < side)).all(axis=1)
            u, v = u[inside], v[inside]
            found.append(
                (pixel[inside, 1] * side + pixel[inside, 0], front[near[inside]], np.stack([1 - u - v, u, v], -1))
            )
    index, face, weights = (np.concatenate(parts) for parts in zip(*found, strict=True))
    near_last = np.argsort(np.einsum("fk,fk->f", weights, depth[faces[face]]), kind="stable")
    winner = np.full(side * side, -1)
    winner[index[near_last]] = near_last
    kept = winner[winner >= 0]
    return index[kept], face[kept], weights[kept], behind[face[kept]]


def _relief(depth: Array) -> Array:
    """Return how far each pixel lies behind its surroundings, -1 to 1: valleys are positive.

    The difference to a blurred depth buffer (Luft, Colditz and Deussen 2006) at two widths; it stands for the light
    that a valley's walls keep out. Pixels outside the surface do not count.
    """
    inside = np.isfinite(depth)
    filled, weight = np.where(inside, depth, 0.0), inside.astype(float)
    relief = np.zeros_like(filled)
    for width, strength in ((len(depth) / 110, 0.5), (len(depth) / 38, 0.5)):
        blurred = ndimage.gaussian_filter(filled, width, truncate=3)
        share = ndimage.gaussian_filter(weight, width, truncate=3)
        behind = np.where(share > 0.5, blurred / np.maximum(share, 1e-6) - filled, 0.0)
        relief += strength * np.tanh(behind * len(depth) / width / 5)
    return np.where(inside, relief, 0.0)


def _paint(colour: Array, resolution: int) -> Array:
    """Return the colours of the vertices of `mesh` at a resolution, bilinear: waves would ring at fronts."""
    n, m = colour.shape[:2]
    # rows beyond the poles are those of the other side
    rows = np.concatenate([np.roll(colour[:1], m // 2, axis=1), colour, np.roll(colour[-1:], m // 2, axis=1)])
    down = (np.arange(resolution) + 0.5) * n / resolution + 0.5
    along = np.arange(2 * resolution) * m / (2 * resolution)
    grid = np.meshgrid(down, along, indexing="ij")
    fine = np.stack(
        [ndimage.map_coordinates(rows[..., k], grid, order=1, mode="grid-wrap").ravel() for k in range(3)], axis=-1
    )
    return np.concatenate([fine, colour[:1].mean(axis=1), colour[-1:].mean(axis=1)])


def _shade(normal: Array, relief: Array, paint: Array | None = None) -> Array:
    key, fill = _KEY / np.linalg.norm(_KEY), _FILL / np.linalg.norm(_FILL)
    depth = np.clip(0.5 + 0.5 * relief, 0, 1)[:, None]
    colour = _RIDGE + (_VALLEY - _RIDGE) * depth if paint is None else paint
    open_sky = 1 - 0.62 * np.clip(relief, 0, 1)[:, None]
    lit = np.clip(normal @ key, 0, None)[:, None]
    half = key + _TO_EYE
    shine = np.clip(normal @ (half / np.linalg.norm(half)), 0, None)[:, None] ** 28
    rim = (1 - np.clip(normal[:, 2:], 0, 1)) ** 3
    light = lit * _KEY_COLOUR + np.clip(normal @ fill, 0, None)[:, None] * _FILL_COLOUR
    light = light + _AMBIENT * (0.6 + 0.4 * normal[:, 1:2])
    return open_sky * (colour * light + 0.22 * shine * lit * (1 - 0.7 * depth)) + 0.05 * rim * _FILL_COLOUR


def _floor_shadow(side: int, view: View, seen: Array, scale: float) -> Array:
    """Return the background with a soft shadow below the surface."""
    tilt = np.sin(np.radians(view.elevation))
    reach = 0.82 * np.abs(seen[:, 0]).max() * scale
    bottom = side / 2 - scale * seen[:, 1].min()
    y, x = np.mgrid[:side, :side] + 0.5
    centre = bottom - 0.75 * reach * tilt
    shadow = np.exp(
        -1.6 * (((x - side / 2) / reach) ** 2 + ((y - centre) / (reach * max(tilt, 0.15) * 1.15)) ** 2) ** 2
    )
    return BACKGROUND * (1 - 0.45 * shadow[..., None])
