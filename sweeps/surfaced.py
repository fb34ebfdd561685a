"""Results that hold no surface, solved again for one: same parameters, same need and seed give the same run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from solver import registry
from solver.contract import Context, Need
from solver.lattice import lattice

if TYPE_CHECKING:
    import xarray as xr

    from solver.arrays import Array

__all__ = ["has_surface", "positions", "surfaced"]


def has_surface(run: xr.Dataset) -> bool:
    """Return whether a result holds something to draw: a mesh of its own, or a field on the fruit's lattice."""
    return "mesh_position" in run or {"colatitude", "azimuth"} <= set(run.dims)


def positions(run: xr.Dataset, index: int) -> Array | None:
    """Return where the lattice (n, 2n, 3) of a result is on a stage; the fresh one where nothing moves it.

    None where it moves and does not say where to, where nobody knows the fresh shape, or where it is a part of one.
    """
    if "position" in run:
        found: Array = run["position"].values[index]
        return found
    name = str(run.attrs.get("solver", ""))
    part = json.loads(run.attrs.get("need", "{}")).get("region") is not None
    if part or "colatitude" not in run.dims or name not in registry.names() or "params" not in run.attrs:
        return None
    solver, values = registry.get(name), json.loads(run.attrs["params"])
    fresh = solver.fresh(values)
    if fresh is None or ("displacement" not in run and not solver.parse(values).keeps_shape):
        return None
    start = fresh.points(*lattice(run.sizes["colatitude"])).astype("f4")
    return start + run["displacement"].values[index] if "displacement" in run else start


def surfaced(run: xr.Dataset, context: Context) -> xr.Dataset | None:
    """Return the run of a result again, with its surface and what gives it colours; None if it cannot be had.

    It cannot where the result is of another version of its solver, or of a part of the surface.

    Raises:
        SolverError: it cannot be solved any more.

    """
    name = str(run.attrs.get("solver", ""))
    if name not in registry.names() or "params" not in run.attrs or "need" not in run.attrs:
        return None
    solver, asked = registry.get(name), json.loads(run.attrs["need"])
    if str(run.attrs.get("solver_version")) != solver.version or asked.get("region") is not None:
        return None
    shape = "position" if "position" in solver.fields else "mesh_position"
    more = (name for name in solver.looks.layers if name in solver.fields)
    need = Need.parse({**asked, "fields": (*asked["fields"], shape, *more)})
    return solver.solve(solver.parse(json.loads(run.attrs["params"])), solver.settle(need), context)
