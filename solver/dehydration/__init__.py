"""Dehydration of core/shell fruits (Liu et al. 2014): from a fresh fruit to buckles, pits and reticular ridges."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from ..contract import Context, Cost, Need, Quality, Solver, StageAxis
from ..fresh import SURFACE
from ..fruit import PRESETS, SIZES
from .drying import CLOCK, LATEST
from .looks import LOOKS
from .params import DehydrationParams

if TYPE_CHECKING:
    import xarray as xr

    from ..arrays import Floats
    from .bifurcation import Onset

__all__ = ["SOLVER", "DehydrationParams", "onset"]

_DESCRIPTORS = (
    "mean_radius",
    "volume",
    "roughness",
    "dominant_degree",
    "wavelength",
    "buckle_count",
    "ridge_anisotropy",
    "penetration",
    "crossings",
    "lattice_penetration",
    "lattice_crossings",
    "lattice_evened",
    "least_jacobian",
)


def _error(params: DehydrationParams, quality: Quality, last: float) -> float:
    from .accuracy import expected_error

    return expected_error(params, quality, last)


def _spin_a_while() -> None:
    """Let OpenMP's threads spin for some 0.1 ms while they wait, as long as one thread's own work in a step takes.

    Read once, when the first parallel loop starts. On idle cores threads that sleep after a third of that, and are
    woken in each step, make an eighth at te 0.02 take 1.3 times as long. Spinning on, as is OpenMP's way, makes two
    runs on the same two cores take 3.7 times as long as if they slept so early; this, 1.2 times.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", "3000")


def _run(params: DehydrationParams, need: Need, context: Context) -> xr.Dataset:
    _spin_a_while()
    # the numerics cost a second to import; parameters and schemas must not
    from .run import run

    return run(params, need, context)


def _relax(
    params: DehydrationParams,
    position: Floats,
    stage: float,
    need: Need,
    context: Context,
    steps: int | None = None,
) -> xr.Dataset:
    _spin_a_while()
    from .relax import relax

    return relax(params, position, stage, need, context, steps)


def _cost(params: DehydrationParams, need: Need) -> Cost:
    from .settings import expected_cost

    return expected_cost(params, need)


def onset(params: DehydrationParams, **options: Any) -> Onset:
    """Return where the fruit starts to buckle, and its first mode; options and errors: `bifurcation.onset`."""
    from . import bifurcation

    return bifurcation.onset(params, **options)


SOLVER = Solver(
    name="dehydration",
    version="19",
    # 13 settles by other ways, to the same limits; 14 goes on from there to the end of the way, 15 on a shorter one; 16
    # holds volumes of skins below te = 0.02 more stiffly while it settles them; 17 dries at fine by default's rungs,
    # and the others with fewer layers of flesh; 18 and 19 relax looked-up shapes otherwise, and run as 17 does
    tables_of=("12", "13", "14", "15", "16", "17", "18"),
    title="Dehydration of core/shell fruits",
    params=DehydrationParams,
    fields=("position", "displacement", "mesh_position", *_DESCRIPTORS, "strain_energy", "released_energy"),
    default_fields=("displacement", *_DESCRIPTORS),
    stages=StageAxis(
        "s",
        "shrinkage s = 1 - theta of the sarcocarp (negative: swelling)",
        "1",
        -0.3,
        LATEST,
        (0.1, 0.15, 0.2, 0.25, 0.3),
    ),
    default_resolution={"preview": 64, "default": 96, "fine": 128},
    # the worst of what was measured: te = 0.04, gamma = 50
    tolerances={"preview": 0.51, "default": 0.4, "fine": 0.35},
    error=_error,
    presets=PRESETS,
    run=_run,
    cost=_cost,
    surface=SURFACE,
    looks=LOOKS,
    onset=onset,
    clock=CLOCK,
    sizes=SIZES,
    relax=_relax,
    incidental=("seed", "imperfection", "imperfection_kind", "pattern", "mirrors"),
)
