"""A shard: one result as one immutable netCDF-4/HDF5 file that knows its question (`key`) and content (`digest`)."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.quantities import QUANTITIES

from . import seal
from .canonical import canonical
from .errors import NO_DAMAGE, CorruptShard

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["digest", "image", "parse", "read", "write"]

#: Attributes of a dataset that belong to its content; others (host, date) may differ between equal results.
_MEANING = ("solver", "solver_version", "params", "need")

_ADVICE = "Delete the file and run the same sweep again: only what is missing is computed."


def digest(dataset: xr.Dataset) -> str:
    """Return the SHA-256 of what a result says, 64 hexadecimal digits: equal for equal results, whoever wrote them.

    Names, dimensions, types, units, coordinates and values count, and the attributes that say what was solved.
    Variables marked volatile (wall time) do not.
    """
    total = hashlib.sha256(canonical([str(dataset.attrs.get(name, "")) for name in _MEANING]))
    for name in sorted(map(str, dataset.variables)):
        if name in QUANTITIES and QUANTITIES[name].volatile:
            continue
        variable = dataset.variables[name]
        values = np.asarray(variable.values)
        text = values.dtype.kind in "OSTU"
        head = {
            "name": name,
            "dims": [str(dim) for dim in variable.dims],
            "shape": list(values.shape),
            "dtype": "text" if text else values.dtype.newbyteorder("<").str,
            "units": str(variable.attrs.get("units", "")),
            "coordinate": name in dataset.coords,
        }
        total.update(canonical(head))
        if text:
            total.update(canonical([_text(item) for item in values.ravel()]))
        else:
            total.update(np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).data)
    return total.hexdigest()


def _text(item: Any) -> str:
    return item.decode() if isinstance(item, bytes) else str(item)


def image(dataset: xr.Dataset, key: str) -> tuple[str, bytes | memoryview]:
    """Return a result's content digest, and its file without the seal.

    HDF5 writes to memory, so that a full disk is the system's clear error and not a library in a broken state.
    """
    content = digest(dataset)
    stored = dataset.drop_encoding().assign_attrs(key=key, digest=content)
    encoding = {name: _encoding(variable) for name, variable in stored.variables.items()}
    return content, stored.to_netcdf(engine="h5netcdf", encoding=encoding)


def write(path: Path, dataset: xr.Dataset, key: str) -> str:
    """Write a result so that it is on the disk, whole, when this returns; return its content digest.

    Raises:
        StorageFull: the disk is full; nothing half-written stays.

    """
    content, data = image(dataset, key)
    with seal.scratch(path) as temporary:
        temporary.write_bytes(data)
        seal.seal(temporary)
        seal.adopt(temporary, path)
    return content


def _encoding(variable: xr.Variable) -> dict[str, Any]:
    encoding: dict[str, Any] = {"_FillValue": None}
    if variable.dtype.kind in "OSTU":
        return {"dtype": "S1"}  # plain characters instead of references into HDF5's heap
    if variable.ndim and variable.size:
        # one stage per chunk: a reader of one stage reads one chunk. Gzip 1 with shuffle saves a sixth of smooth
        # fields for some 20 ms per megabyte; higher levels save 2 % more.
        chunk = tuple(1 if dim == "stage" and variable.ndim > 1 else size for dim, size in variable.sizes.items())
        encoding |= {"fletcher32": True, "chunksizes": chunk, "compression": "gzip", "compression_opts": 1}
        encoding["shuffle"] = True
    return encoding


def read(path: Path, verify: bool = True) -> xr.Dataset:
    """Return the result in `path`, in memory, with the file closed.

    `verify=False` skips the file's seal and the content digest; only for files that were just verified.

    Raises:
        FileNotFoundError: there is no such file.
        CorruptShard: a byte has changed, or the content is not what was written.

    """
    data = path.read_bytes()
    if verify:
        whole = seal.body(data)
        if whole is None:
            raise CorruptShard(f"{path} is damaged or was cut short.", _ADVICE)
        data = whole
    return parse(data, path, verify)


def parse(data: bytes, path: Path, verify: bool = True) -> xr.Dataset:
    """Return the result in a file's content without the seal; `path` names it in errors.

    Raises:
        CorruptShard: the content is not what was written.

    """
    try:
        import xarray as xr

        with xr.open_dataset(io.BytesIO(data), engine="h5netcdf", decode_times=False, decode_timedelta=False) as opened:
            dataset = opened.load()
    except NO_DAMAGE:
        raise
    except Exception as error:  # HDF5 reports damage as whatever it stumbles over: OSError, KeyError, RuntimeError
        raise CorruptShard(f"{path} cannot be read ({type(error).__name__}: {error}).", _ADVICE) from error
    dataset = dataset.drop_encoding()
    if verify and digest(dataset) != dataset.attrs.get("digest"):
        raise CorruptShard(f"{path} does not hold what was written to it.", _ADVICE)
    return dataset
