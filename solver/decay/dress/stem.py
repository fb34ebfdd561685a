"""Stem and calyx of a fruit: small meshes that stand at its poles, for files and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...arrays import Array, Floats, Ints
from ...contract import Part
from ..heap.given import WALL
from .mixed import kinds

__all__ = ["parts"]

#: Sides and rings of a stem; places along a sepal.
_SIDES, _RINGS, _ALONG = 10, 8, 6
#: Brown of dry leaves, linear light.
_WITHERED = np.array([0.10, 0.06, 0.025])
_ROUGHNESS = 0.8
#: Glazed earthenware, linear light, and its roughness; places along and around a bowl.
_GLAZE, _GLOSSY, _DOWN, _AROUND = np.array([0.62, 0.60, 0.55]), 0.25, 16, 96
#: A stem shorter than this is none [r1].
_SHORT = 0.04


def parts(fields: Mapping[str, Array], params: Mapping[str, Any]) -> list[Part]:
    """Return stem and calyx as they are at a stage, and the bowl that a heap lies in.

    Sepals wither as the fruit loses water (`water_lost`). Of a heap of several kinds those of all fruits, by its
    constants.
    """
    heap = params.get("heap") or {}
    below = [_bowl(float(heap["bowl"]))] if heap.get("bowl") else []
    if kinds(params) and "pole_vertex" in fields:
        return [*below, *_of_heap(fields, params)]
    if "peel" not in params or params.get("mesh") or heap:
        return below  # a mesh of one's own has its own, and what is known of a heap of one kind does not say where
    return _of_fruit(params["peel"], float(np.asarray(fields.get("water_lost", 0.0))))


def _of_heap(fields: Mapping[str, Array], params: Mapping[str, Any]) -> list[Part]:
    """Return stems and calyces of all fruits of a heap. A stem is as long as it has room, and was broken off else."""
    looks, found = kinds(params), []
    told = (fields[name] for name in ("fruit_kind", "fruit_size", "fruit_headroom", "pole_vertex", "fruit_water_lost"))
    for kind, size, room, poles, lost in zip(*told, strict=True):
        peel = looks[int(kind)]["peel"]
        free = float(room) / float(size) - float(peel["stem_width"]) / 2
        long = min(float(peel["stem"]), free)
        peel = {**peel, "stem": long if long > _SHORT else 0.0}
        found += [
            part._replace(points=part.points * float(size), vertex=int(poles[part.pole]))
            for part in _of_fruit(peel, float(lost))
        ]
    return found


def _of_fruit(peel: Mapping[str, Any], lost: float) -> list[Part]:
    """Return stem and calyx of a fruit of such a peel that has lost a share of its weight as water."""
    dry = float(np.clip(lost / 0.2, 0, 1))
    found = []
    if peel["stem"] > 0:
        points, faces = _stem(float(peel["stem"]), float(peel["stem_width"]))
        paint = np.tile(np.array(peel["stem_colour"], float), (len(points), 1))
        paint = paint * (0.8 + 0.4 * points[:, 1:2] / float(peel["stem"]))
        found.append(Part("stem", 0, points, faces, paint, _ROUGHNESS))
    if peel["sepals"] > 0:
        points, faces = _calyx(peel, dry)
        fresh = np.array(peel["sepal_colour"], float)
        paint = np.tile(fresh + (_WITHERED - fresh) * dry, (len(points), 1))
        pole = 0 if peel["sepals_at_stem"] else 1
        found.append(Part("calyx", pole, points, faces, paint, _ROUGHNESS))
    return found


def _bowl(opening: float) -> Part:
    """Return what holds a heap, with its foot at the origin: a part of a spherical shell, and its rim."""
    from ...resting import Bowl  # brings compiled code, which those who look at one fruit do without

    bowl = Bowl(opening, WALL)
    inner, outer = bowl.sphere, bowl.sphere + bowl.thickness
    middle = outer
    end = np.arccos((middle - bowl.rim) / inner)
    down = np.linspace(0, end, _DOWN)
    ring = [
        (r * np.sin(a), middle - r * np.cos(a)) for r, angles in ((outer, down), (inner, down[::-1])) for a in angles
    ]
    turn = 2 * np.pi * np.arange(_AROUND) / _AROUND
    points = np.array([[x * np.cos(t), y, x * np.sin(t)] for x, y in ring for t in turn])
    here = np.arange(len(points)).reshape(-1, _AROUND)
    east = np.roll(here, -1, axis=1)
    a, b, c, d = here[:-1], east[:-1], here[1:], east[1:]
    faces = np.concatenate([np.stack([a, c, d], -1).reshape(-1, 3), np.stack([a, d, b], -1).reshape(-1, 3)])
    return Part("bowl", -1, points, faces, np.tile(_GLAZE, (len(points), 1)), _GLOSSY)


def _stem(length: float, width: float) -> tuple[Floats, Ints]:
    """Return a bent tube (v, 3), y along the skin's normal, thicker at both ends, closed at the upper one."""
    t = np.linspace(0, 1, _RINGS)
    bend = 0.28 * length * t**2
    radius = width / 2 * (1 + 0.7 * np.exp(-t * 6) + 0.45 * np.exp(-(1 - t) * 9))
    turn = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.stack([np.cos(turn), np.zeros(_SIDES), np.sin(turn)], axis=1)
    middle = np.stack([bend, -0.04 + (length + 0.04) * t, 0 * t], axis=1)
    points = (middle[:, None] + radius[:, None, None] * ring).reshape(-1, 3)
    points = np.concatenate([points, middle[-1:]])
    here = np.arange(_RINGS * _SIDES).reshape(_RINGS, _SIDES)
    east = np.roll(here, -1, axis=1)
    a, b, c, d = here[:-1], east[:-1], here[1:], east[1:]
    faces = [np.stack([a, c, d], -1).reshape(-1, 3), np.stack([a, d, b], -1).reshape(-1, 3)]
    faces.append(np.stack([np.full(_SIDES, len(points) - 1), east[-1], here[-1]], axis=1))
    return points, np.concatenate(faces)


def _calyx(peel: Mapping[str, Any], dry: float) -> tuple[Floats, Ints]:
    """Return sepals (v, 3) about the pole, along a ball of radius r1 and lifted to their tips; both sides of each."""
    length, width, lift = (float(peel[name]) for name in ("sepal", "sepal_width", "sepal_lift"))
    s = np.linspace(0, 1, _ALONG)
    half = width / 2 * np.sqrt(np.clip(1 - s, 0, 1)) * (0.45 + 0.55 * np.sin(np.pi * np.clip(s * 0.9 + 0.2, 0, 1)))
    out = length * s
    tall = 0.012 - out**2 / 2 + (lift + 0.35 * dry) * length * s**2
    one = []
    for side in (-1.0, 0.0, 1.0):
        one.append(np.stack([out, tall + 0.12 * np.abs(side) * half, side * half], axis=1))
    leaf = np.stack(one, axis=1).reshape(-1, 3)
    a = np.array([3 * i + k for i in range(_ALONG - 1) for k in (0, 1)])
    faces = np.concatenate([np.stack([a, a + 1, a + 4], axis=1), np.stack([a, a + 4, a + 3], axis=1)])
    points, triangles = [], []
    for number in range(int(peel["sepals"])):
        turn = 2 * np.pi * number / int(peel["sepals"]) + 0.25 * np.sin(7.0 * number)
        c, n = np.cos(turn), np.sin(turn)
        points.append(leaf @ np.array([[c, 0, n], [0, 1, 0], [-n, 0, c]]))
        triangles.append(faces + number * len(leaf))
    return np.concatenate(points), np.concatenate(triangles)
