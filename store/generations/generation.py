"""One generation of a table as a file, read: its spectra mapped, its axes and descriptors, its digest.

`generate` writes it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import h5py
import numpy as np

from solver.arrays import Array

from .. import shards
from ..canonical import canonical
from ..errors import NO_DAMAGE, CorruptTable
from ..surfaces.measures import Measures
from ..surfaces.packed import Codes, Packed, Stored

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "CONVERGENCE",
    "DIMS",
    "PACKED",
    "ROWS",
    "Column",
    "Judged",
    "combined",
    "digest",
    "judged",
    "left_out",
    "left_out_names",
    "map_spectra",
    "open",
    "read",
    "skipped",
    "skipped_names",
]

DIMS = ("sample", "stage", "component", "m", "k", "part")
#: Dimensions of packed spectra, see `surfaces.packed`.
PACKED = ("sample", "stage", "wave")
#: Dimensions of what runs say by stage.
ROWS = ("sample", "stage")

#: Rows of a result that say how its run went, not what the surface is like.
CONVERGENCE = ("converged", "residual", "iterations")

_ADVICE = "Rebuild the table from the shards."


class Column(NamedTuple):
    """A small variable of a generation."""

    values: Array
    attrs: Mapping[str, Any]


def read(path: Path, only: Collection[str] | None = None) -> dict[str, Column]:
    """Read all of a generation but its spectra, without xarray, whose import takes longer than a service's start may;
    of some names alone, what there is of them.

    Raises:
        CorruptTable: it cannot be read.

    """
    try:
        with h5py.File(path) as file:
            names = file if only is None else [name for name in only if name in file]
            return {name: _column(file[name]) for name in names if name != "spectrum" and file[name].ndim}
    except NO_DAMAGE:
        raise
    except Exception as error:  # HDF5 reports damage as whatever it stumbles over
        raise CorruptTable(f"{path} cannot be read ({type(error).__name__}: {error}).", _ADVICE) from error


def _column(variable: h5py.Dataset) -> Column:
    values = variable[()]
    if values.dtype.kind == "S":  # letters, one by one
        values = np.array([b"".join(row).decode() for row in values])
    return Column(values, {name: value for name, value in variable.attrs.items() if isinstance(value, str)})


def open(path: Path) -> xr.Dataset:
    """Open a generation lazily; close it after use.

    Raises:
        CorruptTable: it cannot be read.

    """
    import xarray as xr

    try:
        return xr.open_dataset(path, engine="h5netcdf", decode_times=False, decode_timedelta=False)
    except NO_DAMAGE:
        raise
    except Exception as error:  # HDF5 reports damage as whatever it stumbles over
        raise CorruptTable(f"{path} cannot be read ({type(error).__name__}: {error}).", _ADVICE) from error


class Judged(NamedTuple):
    """What a generation says of its own trust: the method whose errors it holds, and how alike neighbours are.

    `neighbour_correlation` has one entry per stored stage. Both are None where they were not stored.
    """

    method: str | None
    neighbour_correlation: tuple[float, ...] | None


def judged(path: Path) -> Judged:
    """Return what a generation file says of its trust, without reading its spectra.

    Raises:
        CorruptTable: it cannot be read.

    """
    first = left_out_names()[0]
    opened = read(path, (first, "neighbour_correlation"))
    found, likeness = opened.get(first), opened.get("neighbour_correlation")
    method = str(found.attrs["method"]) if found else None
    return Judged(method, tuple(likeness.values.tolist()) if likeness else None)


def map_spectra(path: Path) -> Stored:
    """Map the spectra (sample, stage, component, m, k, part) of a generation, read-only; packed ones read alike.

    The mapping outlives the file's name. `path` must have been verified: HDF5 only tells where the values lie.

    Raises:
        CorruptTable: they do not lie there in one piece.

    """
    try:
        with h5py.File(path) as file:
            variable = file["spectrum"]
            offset, shape, dtype = variable.id.get_offset(), variable.shape, variable.dtype
            more = (file["wave_place"][()], file["wave_step"][()]) if len(shape) == len(PACKED) else None
        if offset is None:
            raise ValueError("the spectra are in chunks")
        mapped = np.asarray(np.memmap(path, dtype, "r", offset, shape))
        return mapped if more is None else Packed(Codes(mapped, *more))
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        if isinstance(error, FileNotFoundError):
            raise
        raise CorruptTable(f"the spectra in {path} cannot be mapped ({error}).", _ADVICE) from error


def digest(path: Path) -> str:
    """Compute the digest of a generation's content anew.

    Raises:
        CorruptTable: it cannot be read.

    """
    total = hashlib.sha256()
    stored = map_spectra(path)
    for block in stored.codes if isinstance(stored, Packed) else stored:
        total.update(np.ascontiguousarray(block).data)
    with open(path) as opened:
        small = opened.drop_vars("spectrum").load()
    return combined(small, total.hexdigest())


def left_out(opened: Mapping[str, Column]) -> tuple[Array, str] | None:
    """Return the measures (sample, stage, measure) of samples predicted from the others, and by which method.

    None for a table that holds none: of one sample, or of no fruits.
    """
    names = left_out_names()
    if names[0] not in opened:
        return None
    return np.stack([opened[name].values for name in names], axis=-1), str(opened[names[0]].attrs["method"])


def skipped(opened: Mapping[str, Column]) -> Array | None:
    """Return the measures (sample, stage, measure) of stages predicted from those beside them, if a table has any."""
    names = skipped_names()
    return np.stack([opened[name].values for name in names], axis=-1) if names[0] in opened else None


def skipped_names() -> list[str]:
    """Return the columns that say how far stages are from what those beside them predict."""
    return [f"skipped_{name}" for name in Measures._fields]


def left_out_names() -> list[str]:
    """Return the columns that say how far samples are from what the others predict."""
    return [f"left_out_{name}" for name in Measures._fields]


def combined(small: xr.Dataset, of_spectra: str) -> str:
    """Return the digest of a generation from its small variables and the digest of its spectra."""
    return hashlib.sha256(canonical([shards.digest(small), small.attrs["fixed"], of_spectra])).hexdigest()
