"""What a surface looks like besides its shape: fresh skin, rot and mould as layers of colour (Kider et al., 3.5).

The one place where fields become colours: pictures, vertex colours and textures all ask here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.arrays import Array, Bytes

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LAYERS", "MESH_LAYERS", "Skin", "by_field", "encoded", "layered", "of_run"]


#: Fields that make layers.
LAYERS = ("rot", "mould", "mould_active")
#: Fields of meshes that give them colours.
MESH_LAYERS = ("inside",)

#: Rotten flesh under the skin, and the rim of mould that still grows; linear light.
_ROT = np.array([0.16, 0.075, 0.03])
_RIM = np.array([0.86, 0.86, 0.82])
#: Bark and fresh wood.
_BARK = np.array([0.105, 0.062, 0.036])
_WOOD = np.array([0.63, 0.43, 0.235])
#: Roughness of waxy skin, of wet rot and of felt: chosen by eye, measured by nobody.
_WAX, _WET, _FELT, _DRY = 0.35, 0.6, 1.0, 0.85


class Skin(NamedTuple):
    """Colours (..., 3), linear light, and microfacet roughness (...), both 0 to 1."""

    colour: Array
    roughness: Array


def layered(fields: Mapping[str, Array], params: Mapping[str, Any]) -> Skin | None:
    """Return the look of a surface with fields of rot or mould (...), or of wood `inside`; None if it has neither."""
    if "inside" in fields:
        share = np.asarray(fields["inside"], float)
        return Skin(_over(np.broadcast_to(_BARK, (*share.shape, 3)), _WOOD, share), np.full(share.shape, _DRY))
    known = [np.asarray(fields[name], float) for name in ("rot", "mould") if name in fields]
    if not known or not {"skin_colour", "mould_colour"} <= set(params):
        return None

    def layer(name: str) -> Array:
        return np.asarray(fields[name], float) if name in fields else np.zeros_like(known[0])

    rot, mould, active = (layer(name) for name in LAYERS)
    colour = np.broadcast_to(np.array(params["skin_colour"], float), (*known[0].shape, 3))
    # rot shows long before it is complete, mould hides what is below it
    rotten, felted = 0.9 * _smooth(rot / 0.2), 0.95 * _smooth(mould / 0.25)
    colour = _over(colour, _ROT, rotten)
    # what grows is white while it is thin, and takes its colour with the spores of a dense or a resting mat
    growing = np.clip(active / np.maximum(mould, 1e-9), 0, 1) * (1 - _smooth((mould - 0.2) / 0.3))
    centre = np.array(params["mould_colour"], float)
    colour = _over(colour, centre + (_RIM - centre) * growing[..., None], felted)
    roughness = _WAX + (_WET - _WAX) * rotten
    return Skin(colour, roughness + (_FELT - roughness) * felted)


def of_run(run: xr.Dataset, index: int) -> Array | None:
    """Return the colours (n, 2n, 3), linear light, of one stage of a run with maps of rot or mould; else None."""
    maps = {name: run[name][index].values for name in LAYERS if name in run and "colatitude" in run[name].dims}
    skin = layered(maps, json.loads(run.attrs.get("params", "{}")))
    return None if skin is None else skin.colour


def by_field(values: Array, low: float, high: float) -> Array:
    """Return colours (..., 3), linear light, of a field (...): viridis from `low` to `high`."""
    from matplotlib import colormaps

    share = np.clip((np.asarray(values, float) - low) / max(high - low, 1e-300), 0, 1)
    display = np.asarray(colormaps["viridis"](share))[..., :3]
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


def encoded(linear: Array) -> Bytes:
    """Return linear light, 0 to 1, as the bytes of an sRGB picture (IEC 61966-2-1)."""
    x = np.clip(linear, 0, 1)
    display = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return (255 * display + 0.5).astype(np.uint8)


def _over(below: Array, above: Array, cover: Array) -> Array:
    return below + (above - below) * cover[..., None]


def _smooth(x: Array) -> Array:
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)
