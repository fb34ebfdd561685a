"""A solver with a closed form and a hard corner: ridges that turn by most of a wave around gamma = 60.

On the fresh fruit, u = (-s + s/2 cos(3 (phi - turn)) P) X / |X| with one spherical harmonic: a table is as good as
its interpolation of the ridges' place, which is hard only where they turn. Their height is the same everywhere.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shrinking
import xarray as xr
from scipy.special import sph_harm_y

from solver.contract import Context, Need
from solver.fruit import lattice

__all__ = ["SOLVER"]


def _run(params: shrinking.ShrinkingParams, need: Need, context: Context) -> xr.Dataset:
    smooth = shrinking.SOLVER.run(params, need, context)
    grid = lattice(need.resolution or 0)
    fresh = params.surface(*grid)
    ray = fresh / np.linalg.norm(fresh, axis=-1, keepdims=True)
    corner = np.log(60 * (1 + 8 * (params.exocarp_thickness - 0.03)))
    turn = 0.8 / (1 + np.exp(-(np.log(params.modulus_ratio) - corner) / 0.15))
    ridges = 0.5 * sph_harm_y(6, 3, grid[0], grid[1] - turn).real[..., None] * ray
    s = np.array(need.stages)[:, None, None, None]
    return smooth.assign(displacement=smooth["displacement"] + (s * ridges).astype(need.dtype))


SOLVER = replace(shrinking.SOLVER, name="ridged", title="Ridges that turn", run=_run)
