"""Growth of thin shells (Combaz and Neyret 2004): tools grow the rest state, the shape follows by equilibrium."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..contract import Context, Cost, Extent, Live, LiveEngine, Need, Quality, Solver, StageAxis
from .living.actions import ACTIONS
from .looks import CHANNELS, LOOKS
from .params import GrowthParams
from .presets import PRESETS

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SOLVER", "GrowthParams"]


def _run(params: GrowthParams, need: Need, context: Context) -> xr.Dataset:
    # the kernels cost a second to import; parameters and schemas must not
    from .run import run

    return run(params, need, context)


def _live(params: GrowthParams, quality: Quality) -> LiveEngine:
    from .living.live import GrowingLive
    from .living.warm import warm

    # not in its first steps, while somebody waits for the first dab
    warm()
    return GrowingLive(params, quality)


def _cost(params: GrowthParams, need: Need) -> Cost:
    from .settings import expected_cost

    return expected_cost(params, need)


def _remarks(params: GrowthParams, need: Need) -> str:
    from .told import note

    return note(params, need.quality, need.dtype)


def _extent(params: GrowthParams) -> Extent:
    """Return the box of the start shape, in its own unit."""
    import numpy as np

    from .shapes import start

    points = np.array(params.mesh.points) if params.mesh else start(params.shape, 200, params.aspect).x
    x, y, z = np.ptp(points, axis=0)
    return Extent(np.array([x, z, y]))


SOLVER = Solver(
    name="growth",
    version="12",
    title="Growth of thin shells",
    params=GrowthParams,
    fields=("mesh_position", "elastic_strain", "sheet_thickness", *CHANNELS, "mesh_area", "stored_energy", "rest_area"),
    default_fields=("mesh_position", "mesh_area", "rest_area", "stored_energy"),
    stages=StageAxis("t", "growth time", "1", 0.0, 100.0, (0.25, 0.5, 0.75, 1.0)),
    default_resolution={"preview": 16, "default": 32, "fine": 64},
    # the worst of sheets that curl, hang and ripple (docs/growth.md): the energy of one that ripples
    tolerances={"preview": 0.09, "default": 0.15, "fine": 0.035},
    presets=PRESETS,
    looks=LOOKS,
    run=_run,
    cost=_cost,
    live=Live(ACTIONS, _live, ("elastic_strain", "sheet_thickness", *CHANNELS)),
    extent=_extent,
    remarks=_remarks,
)
