"""What skin has that is finer than a field: lenticels or pores, blush, the ragged edge of felt, fine shrivelling.

All belongs to places on the fresh surface, so that a picture of any size shows the same, and a later stage too.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from ...arrays import Array, Floats, Ints
from ..fields.noise import patches

__all__ = ["creases", "grain", "spotted"]

#: Size of felt's tufts and of its ragged edge, of fine wrinkles, of blush's patches and of its streaks [r1].
_FLUFF, _EDGE, _SHRIVEL, _BLUSH, _STREAK = 0.016, 0.09, 0.03, 0.5, 0.045
#: Mean square slope of `patches` on a surface, times its size squared: 2 from the waves, 2 / (pi sqrt 3) from the map.
_STEEP = 4 / (np.pi * np.sqrt(3))
#: Surplus of lengths from which skin creases finely, and beyond which it folds as a whole, which its shell shows; what
#: of the flesh's shrinkage a skin joins where none was solved. The first two are choices, looked at.
_SOUND, _FOLDED, _JOINED = 0.003, 0.035, 0.5


def grain(points: Array, spacing: float, params: Mapping[str, Any]) -> dict[str, Array]:
    """Return fields (v) at places (v, 3) of the fresh surface [r1], `spacing` apart; none where no peel is said.

    spot: 0 to 1. blush: 0 to 1. fluff, edge, shrivel: -1 to 1. What is too fine for the spacing is left out.
    """
    if "peel" not in params:
        return {}
    peel, seed = params["peel"], int(params.get("seed", 0))
    places = np.asarray(points, float)
    found: dict[str, Array] = {}
    for number, (name, size) in enumerate((("fluff", _FLUFF), ("edge", _EDGE), ("shrivel", _SHRIVEL))):
        if 1.5 * spacing <= size:
            found[name] = patches(places, size, np.random.default_rng([seed, number]))
    if peel["blush"] > 0:
        found["blush"] = _blushed(places, spacing, float(peel["blush"]), float(peel["streak"]), seed)
    radius = float(peel["spot_radius"])
    if peel["spots"] > 0 and spacing <= radius:
        found["spot"] = spotted(places, float(peel["spots"]), radius, seed)
    return found


def creases(shrivel: Array, lost: Array, params: Mapping[str, Any]) -> Array:
    """Return the height (v) [r1] of skin that is too wide for flesh which lost a share of the weight (v) as water.

    shrivel (v): from `grain`. The skin lies in smooth hills between creases, as high as hold just the area that is too
    much: the mean square slope is twice the surplus of area, four times that of lengths.
    """
    skin = params.get("skin") or {}
    flesh = params.get("flesh") or {}
    gone = np.clip(np.asarray(lost, float) * flesh.get("shrinkage", 1.0), 0, 0.99)
    surplus = (1 - skin.get("shrinkage", _JOINED)) * (1 - np.cbrt(1 - gone))
    held = np.clip(surplus, _SOUND, _FOLDED) - _SOUND
    found: Array = _SHRIVEL * np.sqrt(4 * held / _STEEP) * (np.abs(shrivel) - 0.5)
    return found


def _blushed(places: Floats, spacing: float, share: float, streak: float, seed: int) -> Floats:
    """Return how much of the second colour is there: on the side away from the sun, in patches and streaks."""
    generator = np.random.default_rng([seed, 10])
    way = places / np.maximum(np.linalg.norm(places, axis=1, keepdims=True), 1e-12)
    turn = generator.uniform(0, 2 * np.pi)
    shade = 0.75 * (way @ np.array([np.cos(turn), -0.35, np.sin(turn)]))
    shade = shade + 0.3 * patches(places, _BLUSH, generator)
    if streak > 0 and spacing <= _STREAK:
        shade = shade + 0.55 * streak * patches(way * [1.0, 0.1, 1.0], _STREAK, generator)
    x = np.clip(0.5 + 1.1 * (shade + share - 0.5), 0, 1)
    return np.asarray(x * x * (3 - 2 * x))


def spotted(places: Floats, density: float, radius: float, seed: int) -> Floats:
    """Return how deep (v), 0 to 1, places (v, 3) lie in spots: balls strewn in space, that a surface cuts.

    A surface cuts 2 r / a^3 balls of radius r on a unit of its area, with one ball in each cube of side a; radii are
    even between half of `radius` and all of it, so that a^3 = 1.5 radius / density.
    """
    side = max(np.cbrt(1.5 * radius / density), 2 * radius)
    scaled = places / side
    base = np.floor(scaled - 0.5).astype(np.int64)
    found = np.zeros(len(places))
    for corner in product((0, 1), repeat=3):
        cell = base + np.array(corner)
        x, y, z, size = (_hashed(cell, seed, k) for k in range(4))
        away = np.linalg.norm(scaled - cell - np.stack([x, y, z], axis=1), axis=1) * side
        depth = np.clip(1.6 * (1 - away / (radius * (0.5 + 0.5 * size))), 0, 1)
        found = np.maximum(found, depth)
    return found * found * (3 - 2 * found)


def _hashed(cell: Ints, seed: int, what: int) -> Floats:
    """Return a number in [0, 1) for each cell (v, 3): the same on every machine."""
    mixed = cell.astype(np.uint64) @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed = mixed + np.uint64(((seed + 1) * 0x27D4EB2F + what * 0x85EBCA6B) & 0xFFFFFFFFFFFF)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return np.asarray(((mixed ^ (mixed >> np.uint64(31))) >> np.uint64(11)).astype(float) / 2.0**53)
