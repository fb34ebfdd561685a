"""What a camera sees of many instances, from balls around and within them: arrays in, arrays out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from solver.arrays import Array, Floats

from .request import Camera

__all__ = ["BEHIND", "OUTSIDE", "SEEN", "SMALL", "View", "hidden", "view"]

#: Why an instance is left out, or that it is not.
SEEN, OUTSIDE, SMALL, BEHIND = 0, 1, 2, 3
#: Pixels across, below which nothing is shown.
_LEAST = 1.0
#: Height of the picture in which it is told what hides what [cell]. Fewer cells only hide less.
_CELLS = 256
#: Most instances that may hide others, the largest on the screen.
_HIDING = 3000


class View(NamedTuple):
    """By instance (b): why it is left out, its diameter in the middle of the screen [pixel], and its place in the
    camera's frame (b, 3): to the right, up, and ahead [scene unit].
    """

    why: Array
    pixels: Floats
    place: Floats


def frame(camera: Camera) -> Floats:
    """Return the unit vectors to the right, up and ahead, as rows."""
    ahead = np.subtract(camera.target, camera.position)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, ahead), ahead])


def view(camera: Camera, centre: Floats, outer: Floats) -> View:
    """Return which balls of radii `outer` (b) about `centre` (b, 3) meet the camera's pyramid, and how large they are.

    A ball is kept unless it lies wholly beyond one of the pyramid's sides or behind the eye: near the pyramid's edges
    and corners a few are kept that are not seen, none is lost that is.
    """
    place = (centre - np.asarray(camera.position)) @ frame(camera).T
    tall = math.tan(math.radians(camera.fov) / 2)
    wide = tall * camera.width / camera.height
    why = np.zeros(len(centre), np.int8)
    for axis, slope in ((0, wide), (1, tall)):
        beyond = (np.abs(place[:, axis]) - slope * place[:, 2]) / math.hypot(1, slope)
        why[beyond > outer] = OUTSIDE
    why[place[:, 2] < -outer] = OUTSIDE
    distance = np.sqrt(np.einsum("ij,ij->i", place, place))
    # a ball's outline is wider than its diameter at its centre, as near as one may come
    apart = np.sqrt(np.maximum(distance**2 - outer**2, (1e-3 * outer) ** 2))
    pixels = outer / apart * camera.height / tall
    # away from the middle a flat picture draws it longer, most in its corners
    along = np.maximum(place[:, 2] / np.maximum(distance, 1e-300), 1 / math.hypot(1, tall, wide))
    why[(why == SEEN) & (pixels / along**2 < _LEAST)] = SMALL
    return View(why, pixels, place)


def hidden(camera: Camera, found: View, inner: Floats, outer: Floats) -> Array:
    """Return which of the seen instances (b) others surely hide.

    Each hides what lies behind the disc that its inner ball has in the plane across the line of sight ahead: cells of a
    coarse picture that lie wholly within the disc's outline, at the disc's depth. An instance is hidden where every
    cell that the square around its ball touches is nearer than the ball's nearest point.
    """
    tall = math.tan(math.radians(camera.fov) / 2)
    rows = _CELLS
    columns = max(1, min(round(_CELLS * camera.width / camera.height), 8 * _CELLS))
    per = rows / (2 * tall)  # cells of a unit of slope
    depth = np.full((rows, columns), np.inf)
    x, y, z = found.place.T
    seen = np.flatnonzero((found.why == SEEN) & (z - outer > 1e-9))
    out = np.zeros(len(z), bool)
    if len(seen) < 2:
        return out
    u, v = 0.5 * columns + x / np.maximum(z, 1e-9) * per, 0.5 * rows - y / np.maximum(z, 1e-9) * per
    r = inner / np.maximum(z, 1e-9) * per
    ranked = seen[np.argsort(-r[seen], kind="stable")][:_HIDING]
    ranked = ranked[r[ranked] >= 1]
    tops, bottoms = _cells(np.ceil(v - r), np.floor(v + r), rows)
    lefts, rights = _cells(np.ceil(u - r), np.floor(u + r), columns)
    for i in ranked[(tops < bottoms)[ranked] & (lefts < rights)[ranked]]:
        top, bottom, left, right = tops[i], bottoms[i], lefts[i], rights[i]
        # the corner of a cell that is farthest from the middle
        down = np.abs(np.arange(top, bottom) + 0.5 - v[i]) + 0.5
        along = np.abs(np.arange(left, right) + 0.5 - u[i]) + 0.5
        part = depth[top:bottom, left:right]
        np.minimum(part, z[i], out=part, where=down[:, None] ** 2 + along**2 <= r[i] ** 2)
    # the square around a ball's outline
    near, z, s = (z - outer)[seen], z[seen], outer[seen]
    us = [0.5 * columns + per * a for a in _slopes(x[seen], z, s)]
    vs = [0.5 * rows - per * a for a in _slopes(y[seen], z, s)]
    lefts, rights = _cells(np.floor(us[0]), np.ceil(us[1]), columns)
    tops, bottoms = _cells(np.floor(vs[1]), np.ceil(vs[0]), rows)
    for k in np.flatnonzero((tops < bottoms) & (lefts < rights)):
        out[seen[k]] = depth[tops[k] : bottoms[k], lefts[k] : rights[k]].max() < near[k]
    return out


def _cells(low: Floats, high: Floats, most: int) -> tuple[Array, Array]:
    """Return bounds of cells (b), within a picture of so many."""
    return np.clip(low, 0, most).astype(int), np.clip(high, 0, most).astype(int)


def _slopes(x: Floats, z: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Return the least and the largest slope x/z of discs of radii s about (x, z), z > s: their tangents (b)."""
    root = s * np.sqrt(np.maximum(x * x + z * z - s * s, 0.0))
    below = z * z - s * s
    return (x * z - root) / below, (x * z + root) / below
