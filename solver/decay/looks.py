"""Fresh skin, rot and mould as layers of colour (Kider et al. 2011, section 3.5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..contract import Fur, Label, Looks, Skin

__all__ = ["LOOKS"]

_LAYERS = ("rot", "mould", "mould_active")
#: What a cut face has besides: 1 on flesh, 0 on skin. Pale flesh, chosen by eye; linear light.
_FLESH = "flesh"
_PALE = np.array([0.95, 0.87, 0.60])
#: The same when air has come to it for long; linear light, chosen by eye.
_OXIDISED = np.array([0.42, 0.23, 0.08])
#: Skin that is burnt; linear light, chosen by eye.
_BURNT = np.array([0.06, 0.025, 0.01])
#: Rotten flesh under the skin, and the rim of mould that still grows; linear light.
_ROT = np.array([0.16, 0.075, 0.03])
_RIM = np.array([0.86, 0.86, 0.82])
#: Roughness of waxy skin, of wet rot and of felt: chosen by eye, measured by nobody.
_WAX, _WET, _FELT, _DULL = 0.35, 0.6, 1.0, 0.65
#: Share of the weight lost as water at which skin is as brown as it gets, and that brown over the skin's brightness.
_DRIED = 0.6
_BROWN = np.array([0.60, 0.29, 0.11])


def _paint(fields: Mapping[str, Array], params: Mapping[str, Any]) -> Skin | None:
    known = [np.asarray(fields[name], float) for name in _LAYERS if name in fields]
    if not known or not {"skin_colour", "mould_colour"} <= set(params):
        return None

    def layer(name: str) -> Array:
        return np.asarray(fields[name], float) if name in fields else np.zeros_like(known[0])

    rot, mould, active = (layer(name) for name in _LAYERS)
    colour = np.broadcast_to(np.array(params["skin_colour"], float), (*known[0].shape, 3))
    if _FLESH in fields:
        colour = _over(colour, _PALE, np.asarray(fields[_FLESH], float))
    if "roasted" in fields:
        colour = _over(colour, _BURNT, 0.85 * np.asarray(fields["roasted"], float))
    if "browned" in fields:
        colour = _over(colour, _OXIDISED, 0.75 * np.asarray(fields["browned"], float))
    # what dries darkens and turns brown, and its wax goes dull
    dry = float(_smooth(np.asarray(fields.get("water_lost", 0.0)) / _DRIED))
    colour = colour * (1 - 0.35 * dry)
    colour = colour + (_BROWN * colour.sum(axis=-1, keepdims=True) - colour) * (0.6 * dry)
    # rot shows long before it is complete, mould hides what is below it
    rotten, felted = 0.9 * _smooth(rot / 0.2), 0.95 * _smooth(mould / 0.25)
    colour = _over(colour, _ROT, rotten)
    # what grows is white while it is thin, and takes its colour with the spores of a dense or a resting mat
    growing = np.clip(active / np.maximum(mould, 1e-9), 0, 1) * (1 - _smooth((mould - 0.2) / 0.3))
    centre = np.array(params["mould_colour"], float)
    colour = _over(colour, centre + (_RIM - centre) * growing[..., None], felted)
    wax = _WAX + (_DULL - _WAX) * dry
    roughness = wax + (_WET - wax) * rotten
    return Skin(colour, roughness + (_FELT - roughness) * felted)


def _fur(fields: Mapping[str, Array], params: Mapping[str, Any]) -> Fur | None:
    if "mould" not in fields or not {"hyphae", "mould_colour"} <= set(params):
        return None
    given, mould = params["hyphae"], np.asarray(fields["mould"], float)
    active = np.asarray(fields.get("mould_active", np.zeros_like(mould)), float)
    there, grown = _smooth(mould / 0.15), _smooth((mould - 0.02) / 0.6)
    growing = np.clip(active / np.maximum(mould, 1e-9), 0, 1)
    # the rim is young: white, without spores; what rests or is dense has its spores' colour
    young = _smooth(1 - (mould / max(given["margin"], 1e-9)) * (1 - 0.5 * growing))
    centre = np.array(params["mould_colour"], float)
    tip = centre + (_RIM - centre) * young[..., None]
    return Fur(
        given["density"] * there,
        given["length"] * (0.25 + 0.75 * grown) * (there > 0),
        0.5 * (_RIM + tip),
        tip,
        _smooth((mould - 0.15) / 0.4) * (1 - 0.6 * young),
        float(given["density"]),
        float(given["width"]),
        float(given["head"]),
        float(given["lean"]),
    )


def _inside(fields: Mapping[str, Array], depth: Array, params: Mapping[str, Any]) -> dict[str, Array]:
    """Return what is in the flesh: its own fields where it has them, else rot by the body's law; no mould.

    That law is what the skin above has, fading evenly as deep as the body has it.
    """
    if "flesh_rot" in fields:
        return {"rot": np.asarray(fields["flesh_rot"], float), _FLESH: np.ones_like(depth)}
    rot = np.asarray(fields.get("rot", np.zeros_like(depth)), float)
    deep = float(params["flesh"]["rot_depth"])
    return {"rot": rot * np.clip(1 - depth / deep, 0, 1), _FLESH: np.ones_like(depth)}


def _over(below: Array, above: Array, cover: Array) -> Array:
    found: Array = below + (above - below) * cover[..., None]
    return found


def _smooth(x: Array) -> Array:
    x = np.clip(x, 0, 1)
    found: Array = x * x * (3 - 2 * x)
    return found


LOOKS = Looks(
    layers=_LAYERS,
    paint=_paint,
    scalars=("water_lost",),
    fur=_fur,
    inside=_inside,
    advance="Rot",
    labels={
        "t": Label("t", "Days"),
        "temperature": Label("T", "Temperature"),
        "humidity": Label("H", "Humidity"),
        "porosity": Label("P", "Porosity of the skin"),
        "water": Label("W", "Water content"),
        "growth": Label("G", "Growth rate"),
        "propagation": Label("p", "Propagation rate"),
        "firmness": Label("f", "Firmness"),
    },
)
