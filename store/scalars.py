"""Tables of scalars: what each run of a sweep comes to, stage by stage, over all that varies between the runs.

    root/tables/<name>/scalars.nc    netCDF-4/HDF5, sealed; replaced by rename, so that readers keep what they opened

It opens with `xarray.open_dataset(path, engine="h5netcdf")`. Runs that fill a grid lie on it, one dimension per axis;
others lie in a row, with their places as coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from solver import __version__, quantities
from solver.contract import Solver
from solver.quantities import QUANTITIES

from . import shards
from .canonical import canonical
from .errors import CorruptShard, CorruptTable, EmptyTable, UnknownTable
from .generations.samples import Choice, agree, finished, fullest, read_axes, rest_of
from .ledger.jobs import Job
from .manifest import directory
from .store import Store

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ANY", "build", "names", "path_of", "read"]

#: All finished runs.
ANY = Choice()
#: Dimensions of the numbers that are tabulated.
_DIMS = (("stage",), ("stage", "component"))


def build(
    store: Store,
    solver: Solver,
    name: str = "default",
    choice: Choice = ANY,
) -> Path:
    """Tabulate the numbers of those finished runs of `solver` that are chosen; return the path of the table.

    Raises:
        EmptyTable: no finished run fits, or their results have no number in common.
        MixedSamples: the runs are of several versions, or were asked for different stages or qualities.
        UnknownJob: one of the chosen keys is not stored.
        CorruptShard: a run's result is damaged.
        StorageFull: the disk is full; the old table stays.

    """
    jobs = finished(store, solver.name, choice)
    if not jobs:
        fitting = "" if choice[:3] == (None,) * 3 else " in the plan, quality and version asked for"
        said = f"there are no finished runs of {solver.name}{fitting}."
        raise EmptyTable(said, "Run a sweep, or say another solver or plan.")
    agree(jobs)
    axes = solver.params.axes
    chosen = fullest(jobs, [{**read_axes(job.params, axes), **rest_of(job.params, axes)} for job in jobs])
    rows = [_numbers(store.get(job.key)) for job, _ in chosen]
    common = [str(name) for name in rows[0].data_vars if all(name in row for row in rows)]
    if not common:
        raise EmptyTable(f"the results of {solver.name} have no number in common.", "Ask for some with need.fields.")
    table = _table([row[common] for row in rows], [place for _, place in chosen], [job.key for job, _ in chosen])
    units = solver.axis_units()
    for axis in table.coords:
        if axis in units:
            table[axis].attrs.update(quantities.unit_attrs(units[str(axis)]))
    table = table.assign_attrs(_about(solver, chosen))
    path = path_of(store, name)
    shards.write(path, table, name)
    return path


def path_of(store: Store, name: str = "default") -> Path:
    """Return where the scalars of a table are or would be.

    Raises:
        UnknownTable: no table can have that name.

    """
    return directory(store.tables_dir, name) / "scalars.nc"


def names(store: Store) -> list[str]:
    """Return the names of all tables of scalars, sorted."""
    return sorted(path.parent.name for path in store.tables_dir.glob("*/scalars.nc"))


def read(store: Store, name: str = "default") -> xr.Dataset:
    """Return a table of scalars, verified and in memory.

    Raises:
        UnknownTable: there is none of that name.
        CorruptTable: it is damaged.

    """
    path = path_of(store, name)
    try:
        return shards.read(path)
    except FileNotFoundError:
        known = ", ".join(names(store))
        hint = f"Known: {known}." if known else "Build one first."
        raise UnknownTable(f"there are no scalars of a table {name!r}.", hint) from None
    except CorruptShard:
        raise CorruptTable(f"{path} is damaged.", "Build the table again from the shards.") from None


def _numbers(result: xr.Dataset) -> xr.Dataset:
    """Return the numbers of a result per stage, without wall times."""
    keep = [
        name
        for name, variable in result.data_vars.items()
        if variable.dims in _DIMS and not (name in QUANTITIES and QUANTITIES[str(name)].volatile)
    ]
    return result[keep].reset_coords(drop=True).drop_attrs(deep=False)


def _table(rows: Sequence[xr.Dataset], places: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> xr.Dataset:
    """Return numbers on the grid of what varies between the runs, or in a row where they fill none."""
    import xarray as xr

    varying = {
        axis: found for axis in places[0] if len(set(found := [_value(place.get(axis)) for place in places])) > 1
    }
    table = xr.concat(rows, "sample").assign_coords(key=("sample", list(keys)))
    table["key"].attrs["long_name"] = "key of the result"
    # a parameter may have the name of a number
    own = {axis: f"param_{axis}" if axis in table.variables else axis for axis in varying}
    table = table.assign_coords({own[axis]: ("sample", np.array(found)) for axis, found in varying.items()})
    for axis in own.values():
        table[axis].attrs["long_name"] = f"parameter {axis}"
    if np.prod([len(set(found)) for found in varying.values()]) != len(rows):
        return table
    if not varying:
        return table.isel(sample=0)
    if len(varying) == 1:
        (axis,) = own.values()
        return table.swap_dims(sample=axis).sortby(axis).transpose(axis, "stage", ...)
    about = {axis: dict(table[axis].attrs) for axis in own.values()}
    grid = table.set_index(sample=list(own.values())).unstack("sample")
    for axis, attrs in about.items():
        grid[axis].attrs.update(attrs)
    return grid.transpose(*own.values(), "stage", ...)


def _value(value: Any) -> float | str:
    """Return a parameter as a coordinate: a number, or what it says."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return value if isinstance(value, str) else canonical(value).decode()


def _about(solver: Solver, chosen: Sequence[tuple[Job, Mapping[str, Any]]]) -> dict[str, str]:
    first = chosen[0][0]
    fixed = {
        axis: value
        for axis, value in chosen[0][1].items()
        if all(canonical(place.get(axis)) == canonical(value) for _, place in chosen)
    }
    return {
        "title": f"numbers of {solver.name} runs",
        "history": f"put together from {len(chosen)} results by wizen {__version__}",
        "solver": solver.name,
        "solver_version": first.version,
        "params": canonical(first.params).decode(),
        "fixed": canonical(fixed).decode(),
        "need": canonical({**first.need, "fields": []}).decode(),
        "Conventions": "CF-1.11",
    }
