"""Fresh skin, rot and mould as layers of colour (Kider et al. 2011, section 3.5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..contract import Fur, Label, Looks, Matter, Skin
from .dress import mixed
from .dress.grain import creases, grain
from .dress.stem import parts

__all__ = ["LOOKS"]

_LAYERS = ("rot", "rot_age", "mould", "mould_active")
#: What the vertices of a heap of several kinds have besides.
_MIXED = ("kind", "living", "lost")
#: What a cut face has besides: 1 on flesh, 0 on skin. Pale flesh, chosen by eye; linear light.
_FLESH = "flesh"
_PALE = np.array([0.95, 0.87, 0.60])
#: The same when air has come to it for long; linear light, chosen by eye.
_OXIDISED = np.array([0.42, 0.23, 0.08])
#: Skin that is burnt; linear light, chosen by eye.
_BURNT = np.array([0.06, 0.025, 0.01])
#: Rotten flesh under the skin where the parameters say no lesion, and the rim of mould that still grows; linear light.
_ROT = np.array([0.16, 0.075, 0.03])
_RIM = np.array([0.86, 0.86, 0.82])
#: Roughness of waxy skin, of wet rot, of felt, and of dry skin: chosen by eye, measured by nobody.
_WAX, _WET, _FELT, _DULL = 0.35, 0.6, 1.0, 0.65
#: Share of the weight lost as water at which skin is as brown as it gets, and that brown over the skin's brightness.
_DRIED = 0.6
_BROWN = np.array([0.60, 0.29, 0.11])
#: Wax as dust; what it hides and how rough it is where a peel says 1.
_DUST, _DUSTY, _POWDER = np.array([0.62, 0.64, 0.70]), 0.4, 0.4
#: Heights [r1] of felt and of its tufts.
_MAT, _TUFT = 0.006, 0.004
#: How far light goes below a fruit's skin, red, green and blue [r1].
_REACH = (0.08, 0.035, 0.015)


def _paint(fields: Mapping[str, Array], params: Mapping[str, Any]) -> Skin | None:
    known = [np.asarray(fields[name], float) for name in _LAYERS if name in fields]
    if not known or not {"skin_colour", "mould_colour"} <= set(params):
        return None

    def layer(name: str) -> Array:
        return np.asarray(fields[name], float) if name in fields else np.zeros_like(known[0])

    rot, age, mould, active = (layer(name) for name in _LAYERS)
    peel, lesion = params.get("peel", {}), params.get("lesion", {})
    # what dries darkens and turns brown, and its wax goes dull
    dry = _smooth(np.asarray(fields.get("water_lost", 0.0)) / _DRIED)
    colour, wax = _fresh(fields, params, peel, dry, known[0].shape)
    colour = colour * (1 - 0.35 * dry[..., None])
    colour = colour + (_BROWN * colour.sum(axis=-1, keepdims=True) - colour) * (0.6 * dry[..., None])
    wax = wax + (np.maximum(_DULL, wax) - wax) * dry
    # edges are ragged where that is known
    edge, fluff = layer("edge"), layer("fluff")
    rot, mould = rot * (1 + 0.3 * edge), mould * (1 + 0.35 * edge + 0.3 * fluff)
    # rot shows long before it is complete, mould hides what is below it
    rotten, matted = _smooth(rot / 0.2), _smooth(mould / 0.25)
    felted = params.get("hyphae", {}).get("mat", 0.95) * matted
    colour = _over(colour, _lesion(lesion, age), lesion.get("cover", 0.9) * rotten)
    # what grows is white while it is thin, and takes its colour with the spores of a dense or a resting mat
    growing = np.clip(active / np.maximum(mould, 1e-9), 0, 1) * (1 - _smooth((mould - 0.2) / 0.3))
    centre = np.array(params["mould_colour"], float) * (1 + 0.25 * fluff[..., None])
    colour = _over(colour, centre + (_RIM - centre) * growing[..., None], felted)
    roughness = wax + (lesion.get("roughness", _WET) - wax) * rotten
    roughness = roughness + (_FELT - roughness) * matted
    height = None
    if "edge" in fields:
        spots = peel.get("spot_height", 0.0) * layer("spot") * (1 - rotten)
        fine = (
            creases(layer("shrivel"), np.asarray(fields.get("water_lost", 0.0)), params)
            * (1 - rotten)
            * (1 - layer(_FLESH))
        )
        height = spots + fine + felted * (_MAT + _TUFT * fluff)
    return Skin(np.clip(colour, 0, 1), roughness, height)


def _lesion(lesion: Mapping[str, Any], age: Array) -> Array:
    """Return the colours of skin that has been rotten for so long [day]: some pale again from the middle, in rings."""
    colour = np.array(lesion.get("colour", _ROT), float)
    middle = lesion.get("middle")
    if middle is None:
        return colour
    old = age / lesion["paling"]
    # the rings are those of places that came to be rotten together
    darker = 1 - lesion["rings"] * (0.5 - 0.5 * np.cos(2 * np.pi * age / lesion["ring"])) * _smooth(old)
    found: Array = _over(colour, np.array(middle, float), _smooth(old / 2)) * darker[..., None]
    return found


def _fresh(
    fields: Mapping[str, Array], params: Mapping[str, Any], peel: Mapping[str, Any], dry: Array, shape: tuple[int, ...]
) -> tuple[Array, Array]:
    """Return colours and roughness of skin and cut faces that neither rot nor mould, before they have dried."""
    colour = np.broadcast_to(np.array(params["skin_colour"], float), (*shape, 3))
    if "blush" in fields:
        colour = _over(colour, np.array(peel["blush_colour"], float), np.asarray(fields["blush"], float))
    if "spot" in fields:
        cover = peel["spot_cover"] * np.asarray(fields["spot"], float)
        colour = _over(colour, np.array(peel["spot_colour"], float), cover)
    dust = peel.get("bloom", 0.0) * (1 - dry) * (0.7 + 0.3 * np.asarray(fields.get("edge", np.zeros(shape)), float))
    colour = _over(colour, _DUST, _DUSTY * dust)
    wax = np.clip(peel.get("roughness", _WAX) + _POWDER * dust, 0, 1)
    if _FLESH in fields:
        colour = _over(colour, _PALE, np.asarray(fields[_FLESH], float))
    if "roasted" in fields:
        colour = _over(colour, _BURNT, 0.85 * np.asarray(fields["roasted"], float))
    if "browned" in fields:
        colour = _over(colour, _OXIDISED, 0.75 * np.asarray(fields["browned"], float))
    return colour, wax


def _matter(params: Mapping[str, Any]) -> Matter | None:
    kinds = mixed.kinds(params)
    if kinds:
        # one number for all: the mean light below the skins, and no down where most have none
        each = [(one["peel"], kind["fruits"]) for one, kind in zip(kinds, params["heap"]["kinds"], strict=True)]
        total = sum(count for _, count in each)
        below, down = (sum(peel[name] * count for peel, count in each) / total for name in ("subsurface", "fuzz"))
        return Matter(float(below), _REACH, float(down) if down > 0.35 else 0.0)
    peel = params.get("peel")
    return None if peel is None else Matter(float(peel["subsurface"]), _REACH, float(peel["fuzz"]))


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
    layers=(*_LAYERS, *_MIXED),
    paint=mixed.painted(_paint),
    scalars=("water_lost", "fruit_water_lost"),
    constants=("fruit_kind", "fruit_size", "fruit_headroom", "pole_vertex"),
    fresh="fresh_position",
    fur=mixed.furred(_fur),
    grain=mixed.grained(grain),
    parts=parts,
    matter=_matter,
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
