"""Everything about a table that can be checked without running a solver: manifest, generation, the results behind it.

Checks go from the outside in, and a file that is not whole is not opened: HDF5 can crash on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from solver import quantities
from solver.arrays import Array

from .. import seal
from ..errors import CorruptShard, CorruptTable, MixedSamples, UnknownJob
from ..generations import generate, generation
from ..store import Store
from ..surfaces.measures import UNITS
from ..tables import TableInfo, info, is_alone, path_of

__all__ = ["Finding", "verify"]

_REBUILD = "Rebuild the table."
_ALONE = "None of the table's runs is here: it was checked by itself, and gets no more waves than it holds."
#: Largest distance between a stored wave and the run's, over the largest wave of the run: a few roundings, or half a
#: step.
_ROUNDING = {"int16": 2e-5, "float32": 1e-6, "float64": 1e-13}


class Finding(NamedTuple):
    """Something wrong: in which part (manifest, generation, trust, result, run), of what name, and what it is.

    A `remark` is nothing wrong, but worth knowing.
    """

    part: str
    name: str
    message: str
    remark: bool = False


def verify(store: Store, name: str = "default") -> list[Finding]:
    """Check a table to the last byte, and that it could be rebuilt to be the same; return what is wrong.

    Of a table that is here without its runs, as one that comes with wizen, the latter is only remarked.

    Raises:
        UnknownTable: there is none of that name.

    """
    try:
        table = info(store, name)
    except CorruptTable as error:
        return [Finding("manifest", "current.json", str(error))]
    path = path_of(store, table)
    findings = [Finding("generation", path.name, message) for message in _file(path, table)]
    stored = None
    if not findings:
        stored = generation.map_spectra(path)
        with generation.open(path) as opened:
            findings += [Finding("generation", path.name, message) for message in _schema(opened, table)]
            findings += [Finding("trust", path.name, message) for message in _trust(opened)]
    elif info(store, name).file != table.file:
        return verify(store, name)  # another generation is current by now, and this one was deleted perhaps
    if is_alone(store, table):
        return [*findings, Finding("result", "all", _ALONE, remark=True)]
    if stored is not None and stored.shape != _shape(table):
        stored = None
    digests = {job.key: job.digest for job in store.ledger.jobs("done")}
    for i, key in enumerate(table.keys):
        block = None if stored is None else stored[i]
        findings += [Finding("result", key, message) for message in _result(store, table, key, digests.get(key), block)]
    return findings


def _file(path: Path, table: TableInfo) -> Iterator[str]:
    if not path.is_file():
        yield f"{path} is missing. {_REBUILD}"
    elif not seal.is_whole(path):
        yield f"{path} is damaged. {_REBUILD}"
    else:
        try:
            found = generation.digest(path)
        except CorruptTable as error:
            yield str(error)
            return
        if found != table.digest:
            yield f"{path} holds other values than the manifest says. {_REBUILD}"


def _shape(table: TableInfo) -> tuple[int, ...]:
    waves = table.resolution + 1
    return len(table.keys), len(table.stages), 3, waves, waves, 2


def _schema(opened: xr.Dataset, table: TableInfo) -> Iterator[str]:
    """Compare names, dimensions, types, units and coordinates with what the manifest promises."""
    spectrum = opened.variables["spectrum"]
    found: dict[str, Any] = {
        "dimensions": spectrum.dims,
        "shape": spectrum.shape if table.dtype != "int16" else (*spectrum.shape[:2], opened.sizes["m"]),
        "precision": str(spectrum.dtype),
        "units": spectrum.attrs.get("units"),
    }
    wanted: dict[str, Any] = {
        "dimensions": generation.DIMS if table.dtype != "int16" else generation.PACKED,
        "shape": _shape(table) if table.dtype != "int16" else (*_shape(table)[:2], table.resolution + 1),
        "precision": table.dtype,
        "units": quantities.QUANTITIES["displacement"].units,
    }
    for what, value in wanted.items():
        if found[what] != value:
            yield f"the spectrum's {what}: {found[what]}, not {value}. {_REBUILD}"
    missing = {*table.axes, *table.places, *table.descriptors, "stage", "key", "m", "k"} - set(
        map(str, opened.variables)
    )
    if missing:
        yield f"variables are missing: {', '.join(sorted(missing))}. {_REBUILD}"
        return
    said = {"solver": table.solver, "solver_version": table.version, "digest": table.digest}
    for name, value in said.items():
        if opened.attrs.get(name) != value:
            yield f"attribute {name} is {opened.attrs.get(name)!r}, not {value!r}. {_REBUILD}"
    if tuple(map(str, opened["key"].values)) != table.keys:
        yield f"its samples are others than the manifest's. {_REBUILD}"
    if not np.allclose(opened["stage"].values, table.stages, rtol=0, atol=1e-12):
        yield f"its stages are others than the manifest's. {_REBUILD}"
    for axis, (low, high) in table.axes.items():
        values = opened[axis].values
        if (float(values.min()), float(values.max())) != (low, high):
            yield f"{axis} runs from {values.min():g} to {values.max():g}, not from {low:g} to {high:g}. {_REBUILD}"
    for name in table.descriptors:
        known = quantities.QUANTITIES.get(name)
        units = opened[name].attrs.get("units")
        if known is not None and units != known.units:
            yield f"{name} is in {units!r}, not in {known.units!r}. {_REBUILD}"
        if opened[name].dims != ("sample", "stage"):
            yield f"{name} has the dimensions {opened[name].dims}. {_REBUILD}"


def _trust(opened: xr.Dataset) -> Iterator[str]:
    """Check what look-ups believe of the table: finite, in its units, by one method."""
    kinds = [kind for kind in ("left_out", "skipped") if f"{kind}_rgh" in opened]
    names = {f"{kind}_{name}": unit for kind in kinds for name, unit in UNITS.items()}
    if names:
        for name, unit in names.items():
            # tables of before write units as people do
            if name not in opened or opened[name].attrs.get("units") not in (
                unit,
                quantities.unit_attrs(unit)["units"],
            ):
                yield f"{name} is missing, or not in {unit!r}. {_REBUILD}"
    for name in ("spectrum", "degree_power", "band_products", "neighbour_correlation", *names):
        if name in opened and not np.isfinite(opened[name].values).all():
            yield f"{name} is not finite everywhere. {_REBUILD}"


def _result(store: Store, table: TableInfo, key: str, noted: str | None, block: Array | None) -> Iterator[str]:
    """Check one result behind the table, and that the table holds its waves."""
    try:
        result = store.get(key)
        if block is None:
            return
        waves = generate.spectra_of(result, key, table.need, table.resolution)
    except UnknownJob:
        yield "the result is gone: the table could not be rebuilt without it. Run the sweep again."
        return
    except (CorruptShard, MixedSamples) as error:
        yield str(error)
        return
    found, wanted = _asked(result.attrs), {"solver": table.solver, "solver_version": table.version}
    if found != wanted:
        yield f"it is of {found['solver']} version {found['solver_version']}. Rebuild the table without it."
    if noted is not None and result.attrs["digest"] != noted:
        yield "it is not the result that the ledger noted. Delete it and run the sweep again."
    if float(np.abs(block - waves).max()) > _ROUNDING[table.dtype] * float(np.abs(waves).max()):
        yield f"the table holds other values than the result. {_REBUILD}"


def _asked(attrs: Mapping[str, Any]) -> dict[str, Any]:
    return {name: attrs.get(name) for name in ("solver", "solver_version")}
