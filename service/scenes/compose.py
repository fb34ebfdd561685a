"""From a scene to a file and a report: where everything is, what is seen, how fine, and only then what is computed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array, Floats

from ..errors import Wrong
from ..shapes.live import LiveTables
from . import detail, glb, props, report, seen, usd
from .errors import InvalidScene, OverBudget
from .kinds import Kind, Runs, distinct
from .placing import Instances, place
from .request import Scene

__all__ = ["Made", "make"]

#: Formats that hold an item's variants.
_OFFER = ("usdc", "usda")
#: Share of detail that is left, at most, where a file came out larger than expected and is made again.
_LESS = 0.8


class Made(NamedTuple):
    """A scene's file, empty where only its report was asked for, and the report as JSON values."""

    data: bytes
    report: dict[str, Any]


def make(
    scene: Scene,
    tables: LiveTables,
    highest: int,
    to: str = "glb",
    compress: bool = True,
    runs: Runs | None = None,
) -> Made:
    """Return a scene as a file of a format in `request.FORMATS`; `runs` as in `kinds.distinct`.

    Raises:
        InvalidScene: listing what neither tables nor runs hold, a place that is too small, or a camera within a fruit.
        OverBudget: the coarsest shapes cost more than the budget; it says what to drop.
        Unavailable: a format whose library is not installed.

    """
    times, start = {}, time.perf_counter()

    def lap(name: str) -> None:
        nonlocal start
        now = time.perf_counter()
        times[name] = 1e3 * (now - start)
        start = now

    kinds, rows = distinct(scene.items, tables, highest, runs)
    lap("understood")
    everything, rests = place(scene, kinds, rows)
    lap("placed")
    inner, outer = _reaches(scene, kinds, everything, to)
    found = seen.view(scene.camera, everything.centre, outer)
    if scene.cull:
        found.why[seen.hidden(scene.camera, found, inner, outer)] = seen.BEHIND
    else:
        found.why[:] = seen.SEEN
    _check_eye(scene, kinds, everything, outer)
    shown = found.why == seen.SEEN
    visible, pixels = everything.only(shown), found.pixels[shown]
    lap("seen")
    held = props.held(scene) if scene.props else []
    compress = compress and to == "glb" and glb.compressor() is not None
    data, levels = _written(scene, kinds, visible, pixels, held, to, compress)
    lap("computed and written")
    told = report.Told(scene, kinds, rows, everything, found, shown, levels, rests, len(data), compress, times)
    return Made(data, report.document(told))


def _written(
    scene: Scene,
    kinds: Sequence[Kind],
    visible: Instances,
    pixels: Floats,
    held: Sequence[props.Prop],
    to: str,
    compress: bool,
) -> tuple[bytes, detail.Levels]:
    """Return the file of what is seen, empty where only the report was asked for, and its levels of detail.

    Raises:
        OverBudget: the coarsest shapes cost more than the budget; it says what to drop.

    """
    encoders: dict[str, Callable[..., bytes]] = {"glb": glb.encode, "usdc": usd.usdc, "usda": usd.usda}
    encoder = encoders.get(to)
    form = "packed" if compress else ("glb" if encoder is None else to)
    told = kinds, visible.kind, pixels, form
    share = 1.0
    while True:
        levels = detail.choose(scene.budget, *told, share, visible.mirrored, encoder is not None)
        if encoder is None:
            return b"", levels
        more = {"known": frozenset(scene.known)} if to == "glb" else {}
        data = encoder(kinds, visible, levels.n, held, scene.unit, compress, **more)
        if scene.budget.bytes is None or len(data) <= scene.budget.bytes:
            return data, levels
        if (levels.n == detail.RUNGS[0]).all():
            larger = len(data) / levels.bytes
            raise OverBudget.of(detail.over(scene.budget, levels, *told, visible.mirrored, larger))
        # a lattice's bytes go with its square
        share = min(_LESS, math.sqrt(scene.budget.bytes / len(data))) * levels.share


def _reaches(scene: Scene, kinds: Sequence[Kind], everything: Instances, to: str) -> tuple[Floats, Floats]:
    """Return radii of the balls within and around every instance [scene unit], at whatever stage the file may show it.

    Kinds of which nothing is in sight, by a ball around the fresh shape, are not looked up at all.
    """
    shown = [(kind, *kind.variants) if to in _OFFER else (kind,) for kind in kinds]
    fresh = np.array([max(one.fresh_reach for one in stages) for stages in shown])
    outer = fresh[everything.kind] * everything.scale
    inner = np.zeros(len(outer))
    near = seen.view(scene.camera, everything.centre, outer).why == seen.SEEN
    for k in np.unique(everything.kind[near]) if scene.cull else ():
        which = everything.kind == k
        within, around = zip(*(one.reach for one in shown[k]), strict=True)
        inner[which], outer[which] = (radius * everything.scale[which] for radius in (min(within), max(around)))
    return inner, outer


def _check_eye(scene: Scene, kinds: Sequence[Kind], everything: Instances, outer: Floats) -> None:
    """Refuse a camera within a fruit.

    Raises:
        InvalidScene: naming it.

    """
    away = np.asarray(scene.camera.position) - everything.centre
    distance = np.linalg.norm(away, axis=1)
    for i in np.flatnonzero(distance < outer):
        ahead = _turned_back(everything, int(i), away[i]) / everything.scale[i]
        if kinds[everything.kind[i]].holds(ahead):
            item = int(everything.item[i])
            back = math.ceil(100 * outer[i]) / 100
            advice = f"Move it {back:g} or more away from {[round(float(x), 3) for x in everything.centre[i]]}."
            name = kinds[everything.kind[i]].label
            raise InvalidScene.of([Wrong("camera.position", f"is inside a fruit of items.{item} ({name})", advice)])


def _turned_back(everything: Instances, i: int, vector: Array) -> Floats:
    """Return a vector in the frame of an instance."""
    q = everything.turn[i] * [-1, -1, -1, 1]
    cross = 2 * np.cross(q[:3], vector)
    found = vector + q[3] * cross + np.cross(q[:3], cross)
    return np.asarray(found * [-1 if everything.mirrored[i] else 1, 1, 1])
