"""Light, colour and background of a drawn surface."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from solver.arrays import Array
from solver.contract import Worn
from solver.contract.looks import FURROW

__all__ = ["BACKGROUND", "floor_shadow", "relief", "shade"]


#: Paper-white behind the fruits; linear light, 0 to 1.
BACKGROUND = np.array([0.93, 0.91, 0.88])

#: A dried jujube, as which is drawn what nobody says anything of.
_JUJUBE = Worn(np.array([0.53, 0.105, 0.05]), np.array([0.13, 0.016, 0.014]), 0.5, 0.0, np.zeros(3))

#: Directions towards the lights in the camera's frame (right, up, towards the eye), and their colours.
_KEY = np.array([-0.62, 0.62, 0.48])
_FILL = np.array([0.85, 0.10, 0.52])
_TO_EYE = np.array([0.0, 0.0, 1.0])
_KEY_COLOUR = np.array([1.25, 1.18, 1.08])
_FILL_COLOUR = np.array([0.20, 0.24, 0.32])
#: What a smooth skin of a refractive index of 1.45 throws back straight on.
_SPECULAR = 0.034
_AMBIENT = np.array([0.20, 0.19, 0.19])


def relief(depth: Array) -> Array:
    """Return how far each pixel lies behind its surroundings, -1 to 1: valleys are positive.

    The difference to a blurred depth buffer (Luft, Colditz and Deussen 2006) at two widths; it stands for the light
    that a valley's walls keep out. Pixels outside the surface do not count.
    """
    inside = np.isfinite(depth)
    filled, weight = np.where(inside, depth, 0.0), inside.astype(float)
    found = np.zeros_like(filled)
    for width, strength in ((len(depth) / 110, 0.5), (len(depth) / 38, 0.5)):
        blurred = ndimage.gaussian_filter(filled, width, truncate=3)
        share = ndimage.gaussian_filter(weight, width, truncate=3)
        behind = np.where(share > 0.5, blurred / np.maximum(share, 1e-6) - filled, 0.0)
        found += strength * np.tanh(behind * len(depth) / width / 5)
    return np.where(inside, found, 0.0)


def shade(
    normal: Array, behind: Array, paint: Array | None = None, rough: Array | None = None, worn: Worn | None = None
) -> Array:
    """Return linear light (f, 3) of fragments with unit normals (f, 3) in the camera's frame.

    behind: `relief` (f,). worn: the skin's colours of ridges and furrows, a dried jujube's if not given; paint: their
    own (f, 3) instead. rough: their roughness (f,), which spreads the highlight (Blinn's exponent 2 / roughness^4 - 2);
    without it all shine alike.
    """
    key, fill = _KEY / np.linalg.norm(_KEY), _FILL / np.linalg.norm(_FILL)
    depth = np.clip((0.5 if worn is None else FURROW) + 0.5 * behind, 0, 1)[:, None]
    skin = worn or _JUJUBE
    colour = skin.ridge + (skin.furrow - skin.ridge) * depth if paint is None else paint
    open_sky = 1 - 0.62 * np.clip(behind, 0, 1)[:, None]
    lit = np.clip(normal @ key, 0, None)[:, None]
    half = key + _TO_EYE
    shine = np.clip(normal @ (half / np.linalg.norm(half)), 0, None)[:, None]
    if rough is None:
        gloss = 0.22 * shine**28
    else:
        sharp = 2 / np.clip(rough[:, None], 0.15, 1) ** 4 - 2
        gloss = _SPECULAR * (sharp + 2) / 8 * shine**sharp
    rim = (1 - np.clip(normal[:, 2:], 0, 1)) ** 3
    light = lit * _KEY_COLOUR + np.clip(normal @ fill, 0, None)[:, None] * _FILL_COLOUR
    light = light + _AMBIENT * (0.6 + 0.4 * normal[:, 1:2])
    found: Array = open_sky * (colour * light + gloss * lit * (1 - 0.7 * depth)) + 0.05 * rim * _FILL_COLOUR
    return found


def floor_shadow(side: int, elevation: float, seen: Array, scale: float) -> Array:
    """Return the background (side, side, 3) with a soft shadow below the surface.

    elevation: the camera's [degree]. seen: vertices (v, 3) in its frame; scale: sub-pixels per unit.
    """
    tilt = np.sin(np.radians(elevation))
    reach = 0.82 * np.abs(seen[:, 0]).max() * scale
    bottom = side / 2 - scale * seen[:, 1].min()
    y, x = np.mgrid[:side, :side] + 0.5
    centre = bottom - 0.75 * reach * tilt
    shadow = np.exp(
        -1.6 * (((x - side / 2) / reach) ** 2 + ((y - centre) / (reach * max(tilt, 0.15) * 1.15)) ** 2) ** 2
    )
    found: Array = BACKGROUND * (1 - 0.45 * shadow[..., None])
    return found
