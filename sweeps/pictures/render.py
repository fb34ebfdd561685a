"""A small software renderer for surfaces of triangles: no window, no GPU, only numpy.

Lattices are resampled through their spectrum, other triangles are cut in four until they cover few pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from solver.arrays import Array
from solver.contract import Worn
from store.surfaces import spectra

from .raster import finer, normals, rasterise
from .shading import floor_shadow, relief, shade

__all__ = ["More", "View", "mesh", "render", "render_triangles"]


_SUPERSAMPLES = 2
#: Resolution at which surfaces are drawn: one lattice cell of it covers about a pixel of a large picture.
_FINEST = 256
#: Longest side of a triangle's box when it is drawn [sub-pixels]; and the colour of surfaces that have none.
_COARSEST = 16
_CLAY = np.array([0.42, 0.50, 0.20])
#: Roughness of surfaces that say none.
_PLAIN = 0.55


class More(NamedTuple):
    """Triangles that stand on a surface: vertices, colours, normals (v, 3) and triangles (f, 3); as rough as can be."""

    vertices: Array
    triangles: Array
    colour: Array
    normals: Array


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
    roughness: Array | None = None,
    more: More | None = None,
    worn: Worn | None = None,
) -> Array:
    """Return a picture (pixels, pixels, 3), uint8, of a surface (n, 2n, 3) [r1].

    worn: its skin, a dried jujube's if not given. colour: (n, 2n, 3) of the same lattice, linear light, instead of
    a skin's; roughness: (n, 2n). more: what stands on it.
    """
    view = view or View()
    side = pixels * _SUPERSAMPLES
    resolution = int(np.clip(side // 3, len(position), max(_FINEST, len(position))))
    vertices, faces = mesh(position, poles, resolution)
    if colour is not None:
        matt = np.full(colour.shape[:2], _PLAIN) if roughness is None else roughness
        paint = _paint(np.concatenate([colour, matt[..., None]], axis=-1), resolution)
        return _draw(vertices, faces, paint, pixels, view, _frame(view), open_=False, more=more)
    return _draw(vertices, faces, None, pixels, view, _frame(view), open_=False, worn=worn)


def render_triangles(
    vertices: Array,
    triangles: Array,
    pixels: int = 320,
    view: View | None = None,
    colour: Array | None = None,
    up: str = "y",
    roughness: Array | None = None,
    more: More | None = None,
) -> Array:
    """Return a picture (pixels, pixels, 3), uint8, of vertices (v, 3) and triangles (f, 3), seen from both sides.

    The view's middle is the origin. colour: (v, 3), linear light; roughness: (v); up: the axis that points up, y or z.
    more: what stands on it.
    """
    view = view or View()
    frame = _frame(view)
    if up == "z":
        frame = frame[:, [2, 0, 1]]
    paint = np.broadcast_to(_CLAY, np.shape(vertices)) if colour is None else colour
    matt = np.full(len(paint), _PLAIN) if roughness is None else roughness
    paint = np.concatenate([paint, matt[:, None]], axis=1)
    shown = np.asarray(vertices, float), np.asarray(triangles, np.int64)
    return _draw(*shown, paint, pixels, view, frame, open_=True, more=more)


def _draw(
    vertices: Array,
    faces: Array,
    paint: Array | None,
    pixels: int,
    view: View,
    frame: Array,
    open_: bool,
    more: More | None = None,
    worn: Worn | None = None,
) -> Array:
    """Return the picture; paint (v, 4): colours and roughness."""
    side = pixels * _SUPERSAMPLES
    scale = side / 2 / view.extent
    upright = normals(vertices, faces)
    if open_:
        values = np.concatenate([vertices, upright, np.asarray(paint, float)], axis=1)
        values, faces = finer(values, faces, _COARSEST / scale)
        vertices, upright, paint = values[:, :3], values[:, 3:6], values[:, 6:]
    if more is not None and paint is not None:
        faces = np.concatenate([faces, len(vertices) + more.triangles])
        vertices, upright = np.concatenate([vertices, more.vertices]), np.concatenate([upright, more.normals])
        paint = np.concatenate([paint, np.column_stack([more.colour, np.ones(len(more.colour))])])
        open_ = True  # threads are seen from both sides
    seen, turned = vertices @ frame.T, upright @ frame.T
    points = np.stack([side / 2 + scale * seen[:, 0], side / 2 - scale * seen[:, 1]], axis=-1)
    index, face, weights, back = rasterise(points, seen[:, 2], faces, side, open_)
    corners = faces[face]
    depth = np.full(side * side, -np.inf)
    depth[index] = np.einsum("fk,fk->f", weights, seen[corners, 2])
    normal = np.einsum("fk,fkc->fc", weights, turned[corners])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    normal[back] *= -1
    image = floor_shadow(side, view.elevation, seen, scale)
    skin = None if paint is None else np.einsum("fk,fkc->fc", weights, paint[corners])
    behind = relief(depth.reshape(side, side)).ravel()[index]
    if skin is None:
        image.reshape(-1, 3)[index] = shade(normal, behind, worn=worn)
    else:
        image.reshape(-1, 3)[index] = shade(normal, behind, skin[:, :3], skin[:, 3])
    small = image.reshape(pixels, _SUPERSAMPLES, pixels, _SUPERSAMPLES, 3).mean(axis=(1, 3))
    found: Array = (255 * np.clip(small, 0, 1) ** (1 / 2.2) + 0.5).astype(np.uint8)
    return found


def _frame(view: View) -> Array:
    """Return the camera's axes as rows: right, up, towards the eye. The world's y axis is up."""
    turn, tilt = np.radians([view.azimuth, view.elevation])
    eye = np.array([np.cos(tilt) * np.cos(turn), np.sin(tilt), np.cos(tilt) * np.sin(turn)])
    right = np.array([np.sin(turn), 0.0, -np.cos(turn)])
    return np.stack([right, np.cross(eye, right), eye])


def _paint(colour: Array, resolution: int) -> Array:
    """Return values (n, 2n, c) at the vertices of `mesh` of a resolution, bilinear: waves would ring at fronts."""
    n, m = colour.shape[:2]
    # rows beyond the poles are those of the other side
    rows = np.concatenate([np.roll(colour[:1], m // 2, axis=1), colour, np.roll(colour[-1:], m // 2, axis=1)])
    down = (np.arange(resolution) + 0.5) * n / resolution + 0.5
    along = np.arange(2 * resolution) * m / (2 * resolution)
    grid = np.meshgrid(down, along, indexing="ij")
    fine = [ndimage.map_coordinates(rows[..., k], grid, order=1, mode="grid-wrap") for k in range(rows.shape[-1])]
    ends = [colour[:1].mean(axis=1), colour[-1:].mean(axis=1)]
    return np.concatenate([np.stack([field.ravel() for field in fine], axis=-1), *ends])
