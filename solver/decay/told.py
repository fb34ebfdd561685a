"""What a result says of itself in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .params import DecayParams

__all__ = ["note"]

#: Densities over the fresh one between which a fruit needs no explanation.
_LIKELY = (0.8, 1.15)


def note(params: DecayParams, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return why a fruit's density leaves what fruits have, where it does; else nothing."""
    unlikely = [row for row in rows if "density" in row and not _LIKELY[0] <= row["density"] <= _LIKELY[1]]
    if not unlikely:
        return ""
    row = max(unlikely, key=lambda one: abs(one["density"] - 1))
    why = []
    if row["density"] < 1:
        if params.stone[0] > 0:
            why.append("flesh that dries onto a stone, which does not shrink, stays stretched over it")
        if params.skin is not None:
            why.append("the skin holds air below its folds")
    if params.flesh.shrinkage < 1:
        why.append(f"air takes {1 - params.flesh.shrinkage:.0%} of the water's place (flesh.shrinkage)")
    if params.pressure or params.pressure_map is not None:
        why.append("pressure changes the flesh's lengths and not its weight")
    told = "; ".join(why) or "the body is far from what its flesh would fill at rest"
    return f"on day {row['stage']:g} the density is {row['density']:.2f} of the fresh fruit's: {told}."
