"""Columns that stand upright under the skin instead of along rays from the centre.

Where a fruit's surface is oblique to its rays, by 36 degrees where plum 1 wrinkles first, elements along rays are
slanted, and those are poor at wrinkles: on a flat film with waves across the slant and 2.9 elements to a wavelength the
onset comes out 1.5 to 3.7 % high where upright ones miss it by .7 to 2.0 %, and how thin the layers of the flesh are
counts as much as how many elements a wave has. Upright columns follow the interface's normal through the
skin and some way down, from where they lead straight to their foot on the stone. Interface, outer surface and stone
stay where they are; on spheres nothing moves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ...fruit import directions
from ..fresh.mesh import inner_distance
from ..params import DehydrationParams

__all__ = ["parametric", "slanted", "upright"]


_STEP = 1e-5
"""Colatitude [radian] over which the generatrix is differenced."""
_ROUNDS = 8
"""Rounds of finding a point's column: each gains a factor of the slant's change over its depth, some 3 to 5."""


class _Ray(NamedTuple):
    """The ray through points, (k, ...), and where the fruit's surfaces meet it."""

    along: Floats
    """(k, 3)"""
    interface: Floats
    """(k,): distance from the centre"""
    normal: Floats
    """(k, 3): the interface's, outwards"""


def parametric(params: DehydrationParams, points: Floats) -> Floats:
    """Directions (k, 3) on the parametric sphere of the rays through points (k, 3)."""
    squash = params.radii[7] / params.radii[3]
    x, y, z = points[:, 0], points[:, 1], points[:, 2] / squash
    table = np.linspace(0.0, np.pi, 2001)
    gx, gy = params.generatrix(table)
    # the outline seen from the centre turns one way (the fruit's validator): its polar angle can be inverted
    polar = np.arctan2(np.maximum(gx, 0.0), gy)
    colatitude = np.interp(np.arctan2(np.hypot(x, z), y), polar, table)
    return directions(colatitude, np.arctan2(z, x))


def _ray(params: DehydrationParams, points: Floats) -> _Ray:
    towards = parametric(params, points)
    colatitude, azimuth = np.arccos(np.clip(towards[:, 1], -1, 1)), np.arctan2(towards[:, 2], towards[:, 0])
    interface = params.sarcocarp(colatitude, azimuth)
    ahead, back = (np.stack(params.generatrix(colatitude + step)) for step in (_STEP, -_STEP))
    gx, gy = (ahead - back) / (2 * _STEP)
    squash = params.radii[7] / params.radii[3]
    # the tangents' cross product over the distance from the axis, so that the poles have one, too
    normal = np.stack([-squash * gy * np.cos(azimuth), squash * gx, -gy * np.sin(azimuth)], axis=-1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    distance = np.linalg.norm(points, axis=1)
    return _Ray(points / np.maximum(distance, 1e-300)[:, None], np.linalg.norm(interface, axis=1), normal)


def upright(params: DehydrationParams, points: Floats, foot: float) -> Floats:
    """Return where points (k, 3) of straight columns along rays go as their columns rise.

    foot: share of the flesh's depth, 1 at the interface, above which they are upright.
    """
    at = _ray(params, points)
    cosine = np.einsum("ki,ki->k", at.along, at.normal)
    leaning = at.along - cosine[:, None] * at.normal
    distance = np.linalg.norm(points, axis=1)
    flesh = at.interface - inner_distance(params, at.along)
    depth = np.maximum(at.interface - distance, 0.0)
    kept = np.clip((flesh - depth) / (foot * flesh), 0.0, 1.0)
    found: Floats = points + (np.minimum(depth, (1 - foot) * flesh) * kept)[:, None] * leaning
    above = np.flatnonzero(distance > at.interface * (1 + 1e-12))
    if len(above):
        # in the skin: a step along the normal, and on its ray to where the layer is there
        height = (distance - at.interface)[above, None]
        stepped = at.interface[above, None] * at.along[above] + height * cosine[above, None] * at.normal[above]
        there = _ray(params, stepped)
        found[above] = (there.interface[:, None] + height) * there.along
    return found


def slanted(params: DehydrationParams, points: Floats, foot: float) -> Floats:
    """Return the points that `upright` moves to these, (k, 3)."""
    found = points.copy()
    for _ in range(_ROUNDS):
        found += points - upright(params, found, foot)
    return found
