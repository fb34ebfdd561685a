"""One stage of a job's result as a shape, in the formats that looked-up shapes have."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from solver import registry
from solver.contract import Params, Solver, SolverError, Start
from solver.lattice import lattice
from store.errors import StoreError
from store.ledger.jobs import Job

from .. import vocabulary
from ..errors import NotAcceptable
from ..formats import About, Format

if TYPE_CHECKING:
    import xarray as xr

    from store.lookup import ShapeTable

__all__ = ["NETCDF", "begun_from", "encode", "is_surface"]

NETCDF = "application/x-netcdf"


def is_surface(run: xr.Dataset, job: Job) -> bool:
    """Return whether a result holds the whole surface on the lattice."""
    whole = job.need.get("region") is None and {"colatitude", "azimuth"} <= set(run.dims)
    return whole and ("position" in run or "displacement" in run)


def begun_from(job: Job, tables: Callable[[str], ShapeTable]) -> ShapeTable | None:
    """Return the table whose shape a job relaxed, None where it relaxed none or that content is no longer there."""
    start: Mapping[str, Any] = job.need.get("start") or {}
    if not start:
        return None
    try:
        found = tables(str(start["table"]))
    except (StoreError, OSError):
        return None
    return found if found.digest == start["digest"] else None


def encode(run: xr.Dataset, job: Job, stage: float | None, chosen: Format, table: ShapeTable | None) -> bytes:
    """Return one stage of a run in a format of the shapes; `table` is the one that it was relaxed from.

    Raises:
        NotAcceptable: the result is no whole surface.
        InvalidQuery: it has no such stage.

    """
    from sweeps.outputs import of_result
    from sweeps.pictures.colours import shade
    from sweeps.relaxing import looked_up

    solver = vocabulary.solver_named(job.solver)
    params = _params(solver, job)
    stages = [float(value) for value in run["stage"].values]
    near = vocabulary.row_of(stages, stages[-1] if stage is None else stage)
    if is_surface(run, job) and "position" not in run and (fresh := solver.fresh(job.params)) is not None:
        points = fresh.points(*lattice(run.sizes["colatitude"]))
        run["position"] = run["displacement"] + points.astype(run["displacement"].dtype)
    if not is_surface(run, job) or "position" not in run:
        advice = f"Ask for {NETCDF}; a job whose need has the field 'position' and no region is a shape."
        raise NotAcceptable("this result is not a whole surface.", advice=advice)
    axes = vocabulary.axes(job.solver)
    start: Mapping[str, Any] = job.need.get("start") or {}
    rows = run.sizes["colatitude"]
    begun = {} if table is None else looked_up(table, Start(**start), job.params, stages[near], rows)
    shape = replace(
        of_result(run, {name: params.axis(name) for name in axes}, near),
        table=start.get("digest", str(job.digest)),
        method=start.get("method", ""),
        **begun,
    )
    symbol = solver.stages.symbol
    units = {**{name: axis.units for name, axis in axes.items()}, symbol: solver.stages.units}
    fixed, made = _done(solver, params)
    about = About(job.solver, start.get("table", ""), fixed, symbol, units, made=made, reach=solver.stages.reach)
    if chosen.name == "glb":
        skin = shade(job.solver, json.dumps(dict(job.params)))
        about = replace(about, shade=skin, metres=solver.metres(job.params))
    return chosen.encode(shape, about)


def _done(solver: Solver, params: Params) -> tuple[dict[str, float], dict[str, Any]]:
    """Return what answers of tables say besides the axes: other numbers, and how the run was done where that is not
    the usual.
    """
    full, usual = params.full(), params.usual()
    taken = {field for field, _ in params.axes.values()}
    numbers = {k: float(v) for k, v in full.items() if k not in taken and isinstance(v, int | float)}
    made = {name: full[name] for name in solver.incidental if full[name] != usual.get(name)}
    return numbers, made


def _params(solver: Solver, job: Job) -> Params:
    try:
        return registry.get(solver.name).parse(job.params)
    except SolverError:
        raise NotAcceptable(
            f"the result is of version {job.version} of {solver.name}, whose parameters were others.",
            advice=f"Ask for {NETCDF}.",
        ) from None
