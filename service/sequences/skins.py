"""Pictures of a surface's look, finer than its mesh: colour, roughness, normals and height on texture coordinates.

Fields go to the texels first and become colours there, beside what a solver says of places too fine for a mesh. Height
[result's unit] becomes slopes along the surface: a texel's frame is T along u, B towards the picture's upper edge and
the normal, as glTF, USD and MikkTSpace have it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.arrays import Array, Floats
from solver.contract import Matter, Skin
from sweeps.pictures import colours

if TYPE_CHECKING:
    from .view import Sequence, Surface

__all__ = ["Look", "byte", "looked", "matter", "slopes"]

#: Steepest slope that a normal map shows: what is steeper lies across two charts.
_STEEP = 3.0
_GREY = 127.5


class Look(NamedTuple):
    """Pictures (n, n, 3) and (n, n), 8 bits; of height the values [result's unit] of 0 and 255 besides."""

    colour: Array
    roughness: Array | None
    normal: Array | None = None
    height: Array | None = None
    low: float = 0.0
    high: float = 0.0


def byte(share: Array) -> Array:
    """Return values 0 to 1 as bytes."""
    return np.clip(255 * share + 0.5, 0, 255).astype(np.uint8)


def matter(sequence: Sequence) -> Matter | None:
    """Return what is said of the whole material of a result's surface."""
    known = colours.looks(sequence.run).matter
    return None if known is None else known(sequence.params)


def looked(sequence: Sequence, surface: Surface, size: int, full: bool) -> Look:
    """Return the pictures of a stage's surface, with what is finer than the mesh where `full`."""
    assert surface.colour is not None
    skin = _fine(sequence, surface, size) if full and sequence.colour == "auto" else None
    if skin is None:
        rough = None if surface.roughness is None else byte(sequence.baked(surface.roughness, size))
        return Look(colours.encoded(sequence.baked(surface.colour, size)), rough)
    colour, rough = colours.encoded(skin.colour), byte(skin.roughness)
    if skin.height is None:
        return Look(colour, rough)
    low, high = float(skin.height.min()), float(skin.height.max())
    tall = byte((skin.height - low) / max(high - low, 1e-12))
    places = sequence.baked(sequence.fresh, size).astype(float)
    slope = slopes(places, skin.height, wraps=bool(sequence.lattice))
    normal = np.concatenate([-slope, np.ones((size, size, 1))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    pixels = np.clip(_GREY * (1 + normal) + 0.5, 0, 255).astype(np.uint8)
    return Look(colour, rough, pixels, tall, low * sequence.scale, high * sequence.scale)


def _fine(sequence: Sequence, surface: Surface, size: int) -> Skin | None:
    """Return colours (n, n, 3), roughness and height (n, n) of texels; None where nothing finer is known."""
    known = colours.looks(sequence.run)
    if known.grain is None or known.paint is None:
        return None
    grain = sequence.grained(size)
    if not grain:
        return None
    fields = {name: sequence.baked(surface.fields[name], size) for name in known.layers if name in surface.fields}
    return colours.painted(sequence.run, sequence.index_of(surface), {**fields, **grain})


def slopes(places: Floats, height: Array, wraps: bool) -> Floats:
    """Return the slopes (n, n, 2) of a height (n, n) along u and up, over texels' places (n, n, 3).

    wraps: the picture's left edge goes on at its right one.
    """

    def along(values: Array, axis: int) -> Floats:
        found: Floats = np.gradient(np.asarray(values, float), axis=axis)
        if axis == 1 and wraps:
            found = (np.roll(values, -1, axis=1) - np.roll(values, 1, axis=1)) / 2
        return found

    east, south = along(places, 1), along(places, 0)
    a, b = along(height, 1), along(height, 0)
    ee, es, ss = (np.einsum("ijk,ijk->ij", p, q) for p, q in ((east, east), (east, south), (south, south)))
    # the slope along the surface has these shares of the two tangents
    det = np.maximum(ee * ss - es**2, 1e-30)
    along_u = a / np.sqrt(np.maximum(ee, 1e-30))
    # upwards and across u
    away = (b * ee - a * es) / np.sqrt(det * np.maximum(ee, 1e-30))
    found = np.stack([along_u, -away], axis=-1)
    steep = np.linalg.norm(found, axis=-1, keepdims=True)
    limit: Floats = np.where(steep > _STEEP, 0.0, found)
    return limit
