"""Wood (Sutherland 2012): discrete elastic rods, bonded into bundles that bend, splinter and break, in seconds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..contract import Context, Cost, Extent, Need, Solver, StageAxis
from .accuracy import expected_error
from .looks import LOOKS
from .params import Body, Grain, Notch, Waypoint, WoodParams
from .presets import PRESETS, STAGES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SOLVER", "Body", "Grain", "Notch", "Waypoint", "WoodParams"]


def _run(params: WoodParams, need: Need, context: Context) -> xr.Dataset:
    # the numerics cost a second to import; parameters and schemas must not
    from .run import run

    return run(params, need, context)


def _cost(params: WoodParams, need: Need) -> Cost:
    from .settings import expected_cost

    return expected_cost(params, need)


def _remarks(params: WoodParams, need: Need) -> str:
    from .told import note

    return note(params, need)


def _extent(params: WoodParams) -> Extent:
    """Return the box of the bundle as it lies: along x, its section's y across and z upwards; in metres."""
    import numpy as np

    corners = np.array(params.outline or [(-params.radius,) * 2, (params.radius,) * 2])
    across, up = np.ptp(corners, axis=0)
    if params.spine:
        along, side, rise = np.ptp(np.array(params.spine), axis=0)
        return Extent(np.array([along + up, rise + up, side + across]), 1.0)
    sag = abs(params.curvature) * params.length**2 / 8 + abs(params.bend) * params.length
    return Extent(np.array([params.length, up + sag, across]), 1.0)


_NUMBERS = (
    "kinetic_energy",
    "elastic_energy",
    "lost_energy",
    "work",
    "broken_rods",
    "broken_bonds",
    "impulse",
    "body_impulse",
    "body_moment",
    "grip_impulse",
    "grip_moment",
    "fracture_energy",
    "crushing_energy",
    "crack_area",
    "tip_position",
    "body_force",
    "body_torque",
    "body_shift",
    "body_place",
    "body_turn",
    "body_velocity",
    "body_spin",
    "grip_force",
    "grip_torque",
    "grip_shift",
    "grip_turn",
    "fragments",
    "fragment_mass",
    "fragment_place",
    "fragment_length",
)

#: On request: they are as large as the rods' places.
_STRESSES = ("rod_strain", "rod_stress", "rod_crushed", "bond_position", "bond_tension", "bond_shear", "bond_damage")

SOLVER = Solver(
    name="wood",
    version="14",
    title="Wood: bonded rods and splinters",
    params=WoodParams,
    fields=("rod_cut", *_NUMBERS, "rod_position", "mesh_position", "inside", "body", *_STRESSES),
    default_fields=("rod_cut", *_NUMBERS, "rod_position", "mesh_position", "inside", "body"),
    stages=StageAxis("t", "time", "s", 0.0, 60.0, (0.005, 0.01, 0.015, 0.02)),
    default_resolution={"preview": 32, "default": 64, "fine": 128},
    # largest error of a bundle's stiffness and first frequency against the beam's (docs/wood.md)
    tolerances={"preview": 0.02, "default": 0.01, "fine": 0.01},
    presets=PRESETS,
    preset_stages=STAGES,
    run=_run,
    cost=_cost,
    error=expected_error,
    looks=LOOKS,
    extent=_extent,
    remarks=_remarks,
)
