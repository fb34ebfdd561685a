"""What a result says of itself in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .params import DecayParams

__all__ = ["note"]

#: Densities over the fresh one between which a fruit needs no explanation.
_LIKELY = (0.8, 1.15)
#: Temperatures [degC] below which fruits freeze, and above which their flesh suffers: choices.
_FREEZES, _SUFFERS = -1.5, 42.0


def note(params: DecayParams, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return what a reader should know: a climate that nothing lives in, a density that no fruit has; else nothing."""
    return " ".join(filter(None, (_of_climate(params), _of_density(params, rows))))


def _of_climate(params: DecayParams) -> str:
    """Return which temperatures lie outside of what is known of the organisms, or of the flesh."""
    if params.climate != "cardinal" or params.oven is not None:
        return ""
    air = [day.temperature for day in params.weather] or [params.temperature]
    low, high = min(air), max(air)
    said = []
    for name, colony in (("rot", params.rot), ("mould", params.mould)):
        if low <= colony.coldest:
            said.append(f"at {low:g} degC the {name} does not grow, as it does from {colony.coldest:g} on")
        if high >= colony.hottest:
            said.append(f"at {high:g} degC the {name} does not grow, as it does up to {colony.hottest:g}")
    if low < _FREEZES:
        said.append("what frost does to flesh is left out")
    if high > _SUFFERS:
        said.append("what heat does to flesh is left out, but for an oven's")
    told = "; ".join(said)
    return f"{told[0].upper()}{told[1:]}." if told else ""


def _of_density(params: DecayParams, rows: Sequence[Mapping[str, Any]]) -> str:
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
