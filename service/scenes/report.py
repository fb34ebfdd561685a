"""What was done about each item of a scene, and what that saved."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array
from solver.resting import Rest

from ..formats.about import GENERATOR
from . import seen
from .detail import Levels
from .kinds import Kind
from .placing import Instances
from .request import Scene

__all__ = ["Told", "document"]

_WHY = {seen.OUTSIDE: "out of the picture", seen.SMALL: "smaller than a pixel", seen.BEHIND: "behind others"}


class Told(NamedTuple):
    """What a scene came to."""

    scene: Scene
    kinds: Sequence[Kind]
    rows: Sequence[Sequence[int]]
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
    # lists, since most items are one instance, of which arrays are slow to ask
    one = _Ranks(*(values.tolist() for values in (told.everything.kind, told.shown, told.found.why, n, wanted)))
    ranks, bounds = order.tolist(), ends.tolist()
    items = [
        _item(told, i, ranks[bounds[i] : bounds[i + 1]], one, spent, least, first) for i in range(len(told.scene.items))
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
        "missing": sum(_lacks(kind) != {} for kind in told.kinds),
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


class _Ranks(NamedTuple):
    """By instance: its kind, whether it is shown, why not, its lattice, and the lattice that the screen asks for."""

    kind: list[int]
    shown: list[bool]
    why: list[int]
    n: list[int]
    wanted: list[int]


def _item(
    told: Told,
    i: int,
    rows: list[int],
    ranks: _Ranks,
    spent: Mapping[int, float],
    least: float,
    first: set[tuple[int, int]],
) -> dict[str, Any]:
    one, kind = told.scene.items[i], told.kinds[told.rows[i][0]]
    if len(rows) == 1 and not ranks.shown[rows[0]]:
        # most items of a large scene
        return {
            "name": one.name or kind.label,
            **kind.source,
            "instances": 1,
            "shown": 0,
            "computed": [],
            "shared": 0,
            "reduced": 0,
            "skipped": {_WHY[ranks.why[rows[0]]]: 1},
            "lattices": {},
            "milliseconds_saved": round(least if kind.topology is None else 0.0, 2),
            **_lacks(kind),
        }
    if len(rows) == len(told.rows[i]) == 1 and kind.missing is None and not kind.variants:
        return _single(told, i, rows[0], ranks, spent, least, first)
    shown = [row for row in rows if ranks.shown[row]]
    lattices = sorted(Counter(ranks.n[row] for row in shown).items())
    pairs = sorted({(ranks.n[row], ranks.kind[row]) for row in shown})
    made = [(k, size) for size, k in pairs if (k, size) not in first]
    first |= set(made)
    alone = sum(spent.get(size, least) * count for size, count in lattices) + least * (len(rows) - len(shown))
    alone = alone if kind.topology is None else 0.0  # what is stored is read, whoever asks
    used = sum(1e3 * told.kinds[k].spent.get(size, 0.0) for k, size in made)
    left = Counter(ranks.why[row] for row in rows)
    said: dict[str, Any] = {
        "name": one.name or kind.label,
        **kind.source,
        "instances": len(rows),
        "shown": len(shown),
        "computed": [size for _, size in made],
        "shared": max(len(shown) - len(made), 0),
        "reduced": sum(ranks.n[row] < ranks.wanted[row] for row in shown),
        "skipped": {text: left[code] for code, text in _WHY.items() if left[code]},
        "lattices": {str(size): count for size, count in lattices},
        "milliseconds_saved": round(max(alone - used, 0.0), 2),
    }
    said |= _lacks(kind)
    if kind.variants:
        said["variants"] = [other.label for other in kind.variants]
    if len(told.rows[i]) > 1:
        said["shapes"] = len({k for _, k in pairs})
    return said | _worst(told.kinds, pairs)


def _lacks(kind: Kind) -> dict[str, Any]:
    """Return which run is not stored: the item's own, or else that of a variant."""
    lacking = [one.missing for one in (kind, *kind.variants) if one.missing is not None]
    return {"missing": lacking[0].to_json()} if lacking else {}


def _single(
    told: Told, i: int, row: int, ranks: _Ranks, spent: Mapping[int, float], least: float, first: set[tuple[int, int]]
) -> dict[str, Any]:
    """Return what `_item` says of one instance that is shown: most items that are in the picture, said fast."""
    k, size = ranks.kind[row], ranks.n[row]
    kind, is_made = told.kinds[k], (k, size) not in first
    first.add((k, size))
    alone = spent.get(size, least) if kind.topology is None else 0.0
    used = 1e3 * kind.spent.get(size, 0.0) if is_made else 0.0
    return {
        "name": told.scene.items[i].name or kind.label,
        **kind.source,
        "instances": 1,
        "shown": 1,
        "computed": [size] if is_made else [],
        "shared": 0 if is_made else 1,
        "reduced": int(size < ranks.wanted[row]),
        "skipped": {},
        "lattices": {str(size): 1},
        "milliseconds_saved": round(max(alone - used, 0.0), 2),
        **kind.trust([size]),
    }


def _worst(kinds: Sequence[Kind], pairs: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """Return what those shapes say of themselves that are least to be trusted, of kinds with levels and of variants."""

    def doubt(one: dict[str, Any]) -> tuple[bool, bool, bool, float]:
        known = one.get("expected_error")
        most = max(map(abs, (known or {}).values()), default=0.0)
        return one.get("converged") is False, known is None, one.get("exact") is False, most

    levels: dict[int, list[int]] = {}
    for n, k in pairs:
        levels.setdefault(k, []).append(n)
    said = [one.trust(own) for k, own in levels.items() for one in (kinds[k], *kinds[k].variants)]
    return max(filter(None, said), key=doubt, default={})
