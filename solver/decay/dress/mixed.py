"""Looks of a heap of several kinds: what is said of one fruit, done for each kind and what lives on it.

A place has `kind`, the number of its fruit's kind, `living`, that whose organism rots it, and `lost`, the water that
its fruit has lost. Skin, stem and pores are the kind's; lesion, felt and the colour of spores are those of what lives
there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ...arrays import Array, Floats
from ...contract import Fur, Skin
from ..presets import FRUITS

__all__ = ["furred", "grained", "kinds", "painted"]

Fields = Mapping[str, Array]
Told = Mapping[str, Any]
#: Looks of a fruit's skin, and of what rots it.
_SKIN, _ROT = ("peel", "skin_colour"), ("hyphae", "lesion", "mould_colour")


def kinds(params: Told) -> list[Told]:
    """Return the presets of a heap's kinds, none where it has one kind alone."""
    heap = params.get("heap") or {}
    return [FRUITS[one["preset"]] for one in heap.get("kinds", ())]


def _parts(fields: Fields, params: Told) -> Iterator[tuple[Array, Fields, Told]]:
    """Yield which places (v) are of one kind and organism, their fields, and the parameters of such a fruit."""
    told = kinds(params)
    kind = np.rint(fields["kind"]).astype(int)
    living = np.rint(fields.get("living", kind)).astype(int)
    for k, s in sorted(set(zip(kind.ravel().tolist(), living.ravel().tolist(), strict=True))):
        there = (kind == k) & (living == s)
        own = {name: values[there] for name, values in fields.items() if np.shape(values) == kind.shape}
        if "lost" in own:
            own["water_lost"] = own["lost"]
        yield there, own, {**params, **{n: told[k][n] for n in _SKIN}, **{n: told[s][n] for n in _ROT}}


def painted(paint: Callable[[Fields, Told], Skin | None]) -> Callable[[Fields, Told], Skin | None]:
    """Return how several kinds are painted, from how one is."""

    def of(fields: Fields, params: Told) -> Skin | None:
        if "kind" not in fields or not kinds(params):
            return paint(fields, params)
        shape = np.shape(fields["kind"])
        colour, rough, height = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
        tall = False
        for there, own, told in _parts(fields, params):
            skin = paint(own, told)
            if skin is None:
                return None
            colour[there], rough[there] = skin.colour, skin.roughness
            if skin.height is not None:
                height[there], tall = skin.height, True
        return Skin(colour, rough, height if tall else None)

    return of


def furred(fur: Callable[[Fields, Told], Fur | None]) -> Callable[[Fields, Told], Fur | None]:
    """Return what stands on several kinds, from what stands on one."""

    def of(fields: Fields, params: Told) -> Fur | None:
        if "kind" not in fields or not kinds(params):
            return fur(fields, params)
        count, peak = len(fields["kind"]), 0.0
        found: dict[str, Floats] = {}
        for there, own, told in _parts(fields, params):
            one = fur(own, told)
            if one is None:
                return None
            peak = max(peak, one.peak)
            for name, values in one._replace(peak=0.0)._asdict().items():
                known = np.asarray(values, float)
                whole = found.setdefault(name, np.zeros((count, *known.shape[1:])))
                whole[there] = known
        return Fur(**{**found, "peak": peak})  # type: ignore[arg-type]

    return of


def grained(
    grain: Callable[[Array, float, Told], dict[str, Array]],
) -> Callable[[Array, float, Told, Fields], dict[str, Array]]:
    """Return what several kinds have that is finer than a field, from what one has."""

    def of(points: Array, spacing: float, params: Told, fields: Fields) -> dict[str, Array]:
        if "kind" not in fields or not kinds(params):
            return grain(points, spacing, params)
        kind = np.rint(fields["kind"]).astype(int)
        found: dict[str, Floats] = {}
        for k, told in enumerate(kinds(params)):
            there = kind == k
            if there.any():
                for name, values in grain(points[there], spacing, {**params, "peel": told["peel"]}).items():
                    found.setdefault(name, np.zeros(len(points)))[there] = values
        return dict(found)

    return of
