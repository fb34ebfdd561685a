"""Decay of fruits (Kider, Raja and Badler 2011): nutrient, soft rot and mould on the fruit's own surface, in days."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..contract import Context, Cost, Need, Solver, StageAxis
from ..fresh import SURFACE
from .accuracy import expected_error
from .looks import LOOKS
from .names import ALL, DEFAULT
from .params import DecayParams, Weather
from .presets import PRESETS, SIZES
from .surfaces.places import Wound

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SOLVER", "DecayParams", "Weather", "Wound"]


def _run(params: DecayParams, need: Need, context: Context) -> xr.Dataset:
    # the numerics cost a second to import; parameters and schemas must not
    from .run import run

    return run(params, need, context)


def _cost(params: DecayParams, need: Need) -> Cost:
    from .settings import expected_cost

    return expected_cost(params, need)


SOLVER = Solver(
    name="decay",
    version="11",
    title="Decay of fruits: rot and mould",
    params=DecayParams,
    fields=ALL,
    default_fields=DEFAULT,
    stages=StageAxis("t", "time since the wounds", "day", 0.0, 120.0, (5.0, 10.0, 15.0, 20.0)),
    default_resolution={"preview": 64, "default": 128, "fine": 256},
    # the worst of what was measured; which runs reach less, `error` says (docs/decay.md)
    tolerances={"preview": 0.15, "default": 0.055},
    error=expected_error,
    presets=PRESETS,
    sizes=SIZES,
    run=_run,
    cost=_cost,
    surface=SURFACE,
    looks=LOOKS,
)
