"""What was done about each item of a scene, and what that saved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array
from solver.resting import Rest

from ..formats.about import GENERATOR
from . import seen
from .detail import Levels
from .kinds import COARSE, Kind
from .placing import Instances
from .request import Scene

__all__ = ["Told", "document"]

_WHY = {seen.OUTSIDE: "out of the picture", seen.SMALL: "smaller than a pixel", seen.BEHIND: "behind others"}


class Told(NamedTuple):
    """What a scene came to."""

    scene: Scene
    kinds: Sequence[Kind]
    rows: Sequence[int]
    everything: Instances
    found: seen.View
    shown: Array
    levels: Levels
    rests: Mapping[str, Rest]
    size: int
    compressed: bool
    times: Mapping[str, float]


def document(told: Told) -> dict[str, Any]:
    """Return the report as JSON values.

    An item's `milliseconds_saved` are those of look-ups that a request for each individual would have taken, each at
    the lattice that the screen asks for (for what is not shown: at this scene's coarsest), less those that were made.
    """
    spent = _by_lattice(told.kinds)
    n = np.zeros(len(told.shown), int)
    wanted = np.zeros(len(told.shown), int)
    n[told.shown], wanted[told.shown] = told.levels.n, told.levels.wanted
    order = np.argsort(told.everything.item, kind="stable")
    ends = np.searchsorted(told.everything.item[order], np.arange(len(told.scene.items) + 1))
    first: set[tuple[int, int]] = set()
    least = min(spent.values(), default=0.0)
    items = [
        _item(told, i, order[ends[i] : ends[i + 1]], n, wanted, spent, least, first)
        for i in range(len(told.scene.items))
    ]
    why = {text: int((told.found.why == code).sum()) for code, text in _WHY.items()}
    distinct = sorted(
        {(int(k), int(size)) for k, size in zip(told.everything.kind[told.shown], told.levels.n, strict=True)}
    )
    return {
        "generator": GENERATOR,
        "instances": len(told.shown),
        "shown": int(told.shown.sum()),
        "left_out": why,
        "kinds": len(told.kinds),
        "meshes": len(distinct),
        "triangles": told.levels.triangles,
        "bytes": told.size,
        "bytes_expected": round(told.levels.bytes),
        "compressed": told.compressed,
        "detail": {"share": round(told.levels.share, 4), "lattices": np.unique(told.levels.n).tolist()},
        "milliseconds": {name: round(value, 2) for name, value in told.times.items()},
        "milliseconds_saved": round(sum(item["milliseconds_saved"] for item in items), 1),
        "places": {name: {"still": rest.still, "speed": round(rest.speed, 4)} for name, rest in told.rests.items()},
        "items": items,
    }


def _by_lattice(kinds: Sequence[Kind]) -> dict[int, float]:
    """Return the least processor time of a look-up by lattice [ms], of those that were made."""
    found: dict[int, list[float]] = {}
    for kind in kinds:
        for n, seconds in kind.spent.items():
            found.setdefault(n, []).append(1e3 * seconds)
    return {n: min(values) for n, values in found.items()}


def _item(
    told: Told,
    i: int,
    rows: Array,
    n: Array,
    wanted: Array,
    spent: Mapping[int, float],
    least: float,
    first: set[tuple[int, int]],
) -> dict[str, Any]:
    one, k = told.scene.items[i], told.rows[i]
    kind = told.kinds[k]
    if len(rows) == 1 and not told.shown[rows[0]]:
        # most items of a large scene
        return {
            "name": one.name or kind.label,
            "table": kind.table.info.name,
            "instances": 1,
            "shown": 0,
            "computed": [],
            "shared": 0,
            "reduced": 0,
            "skipped": {_WHY[int(told.found.why[rows[0]])]: 1},
            "lattices": {},
            "milliseconds_saved": round(least, 2),
        }
    shown = rows[told.shown[rows]]
    lattices, counts = np.unique(n[shown], return_counts=True)
    computed = [int(size) for size in lattices if (k, int(size)) not in first]
    first |= {(k, size) for size in computed}
    alone = sum(spent.get(int(size), least) for size in n[shown]) + least * (len(rows) - len(shown))
    used = sum(1e3 * kind.spent.get(size, 0.0) for size in computed)
    left = {text: int((told.found.why[rows] == code).sum()) for code, text in _WHY.items()}
    said: dict[str, Any] = {
        "name": one.name or kind.label,
        "table": kind.table.info.name,
        "instances": len(rows),
        "shown": len(shown),
        "computed": computed,
        "shared": max(len(shown) - len(computed), 0),
        "reduced": int((n[shown] < wanted[shown]).sum()),
        "skipped": {text: count for text, count in left.items() if count},
        "lattices": {str(size): int(count) for size, count in zip(lattices, counts, strict=True)},
        "milliseconds_saved": round(max(alone - used, 0.0), 2),
    }
    looked = [kind.shapes[int(size)] for size in lattices if int(size) in kind.shapes] or (
        [kind.shapes[COARSE]] if COARSE in kind.shapes else []
    )
    if looked:
        shape = looked[-1]
        error = shape.expected_error
        said["expected_error"] = None if error is None else {name: round(v, 5) for name, v in error.items()}
        said["exact"], said["converged"] = shape.exact, shape.converged
    return said
