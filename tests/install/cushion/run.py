"""The height grows by `give` times the pressure; the width stays."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ..contract import Context, Need
from ..lattice import azimuths, colatitudes, lattice
from . import CushionParams, Rest

__all__ = ["run"]


def run(params: CushionParams, need: Need, context: Context) -> xr.Dataset:
    """Return the displacement, exactly."""
    n = need.resolution or 16
    p = np.asarray(need.stages)
    context.check_cancelled()
    u = params.give * p[:, None, None, None] * Rest(params.flatness).points(*lattice(n)) * [0, 1, 0]
    fields = {
        "displacement": (("stage", "colatitude", "azimuth", "component"), u.astype(need.dtype)),
        "plumpness": ("stage", params.flatness * (1 + params.give * p)),
    }
    told = {
        "converged": ("stage", np.ones(len(p), np.int8)),
        "residual": ("stage", np.zeros(len(p))),
        "iterations": ("stage", np.ones(len(p), int)),
        "seconds": ("stage", np.zeros(len(p))),
    }
    coords = {"stage": p, "colatitude": colatitudes(n), "azimuth": azimuths(n), "component": ["x", "y", "z"]}
    return xr.Dataset({name: field for name, field in fields.items() if name in need.fields} | told, coords)
