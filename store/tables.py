"""Tables: a consolidated, read-only generation of results for look-up.

    root/tables/<name>/<digest>.h5    a generation, netCDF-4/HDF5, sealed
    root/tables/<name>/current.json   which one is current, and what is in it
    root/tables/<name>/scalars.nc     numbers of the runs over their axes, see `scalars`

A new generation becomes current by renaming the manifest; whoever has the old one open keeps it until it reopens,
even when it is pruned. Who makes or prunes generations of one table waits for who does so already; readers wait never.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Collection, Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from solver.contract import Solver

from . import seal
from .errors import CorruptTable, EmptyTable, MixedSamples, StoreError, UnknownJob, full_disk
from .generations import generate, generation, own
from .generations.samples import Choice, collect
from .manifest import TableInfo, directory, read_manifest, write_manifest
from .store import Store

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Precision", "TableInfo", "build", "check_grows", "info", "is_alone", "open", "path_of", "prune", "rebuild"]

#: How a spectrum's numbers are stored; int16 is packed, see `surfaces.packed`.
Precision = Literal["int16", "float32", "float64"]


def build(
    store: Store,
    solver: Solver,
    name: str = "default",
    *,
    plan: str | None = None,
    quality: str | None = None,
    version: str | None = None,
    keys: Collection[str] | None = None,
    resolution: int | None = None,
    dtype: Precision = "float32",
    text: str = "",
) -> TableInfo:
    """Build a table from the finished runs of `solver` and make it current.

    `keys` names the results, if not all that fit are wanted; `resolution` cuts the spectra to that band, and so the
    lattice that holds them; `text` is the plan as it is written, for those who want to make more. The same results make
    the same digest, in whatever order they were stored.

    Raises:
        EmptyTable: no finished run fits.
        MixedSamples: the runs differ in more than their axes.
        UnknownJob: one of `keys` is not stored.
        CorruptShard: a run's result is damaged.
        StorageFull: the disk is full; the old generation stays current.

    """
    samples = collect(store, solver.name, solver.params.axes, Choice(plan, quality, version, keys))
    home = directory(store.tables_dir, name)
    with full_disk(home):
        seal.make_directory(home)
    with _turn(store, name):
        return _write(store, solver, name, generate.results(store, samples), resolution, dtype, text)


@contextlib.contextmanager
def _turn(store: Store, name: str) -> Iterator[None]:
    """Wait until nobody else makes or prunes generations of a table; what is current changes for nobody else meanwhile.

    Raises:
        UnknownTable: there is none of that name.

    """
    try:
        handle = os.open(directory(store.tables_dir, name), os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except FileNotFoundError:
        info(store, name)  # says so
        raise
    try:
        with contextlib.suppress(OSError):  # some network file systems lock no directories
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _write(
    store: Store,
    solver: Solver,
    name: str,
    source: generate.Source,
    resolution: int | None,
    dtype: Precision,
    text: str,
) -> TableInfo:
    home, samples = directory(store.tables_dir, name), source.samples
    band = min(resolution or samples.need["resolution"], samples.need["resolution"])
    if band < 4:
        raise EmptyTable(f"a band of {band} waves holds no shape.", "Ask for a resolution of at least 4.")
    with seal.scratch(home / "next.h5") as temporary:
        written = generate.write(temporary, source, solver, band, dtype)
        seal.seal(temporary)
        file = f"{written.digest[:16]}.h5"
        seal.adopt(temporary, home / file)
    table = TableInfo(
        name=name,
        file=file,
        digest=written.digest,
        solver=solver.name,
        version=samples.version,
        axes={axis: _bounds(values[axis] for values in samples.values) for axis in samples.varying},
        fixed=samples.fixed,
        stages=tuple(samples.need["stages"]),
        resolution=band,
        dtype=dtype,
        samples=len(samples.keys),
        descriptors=written.descriptors,
        need=samples.need,
        template=samples.template,
        places=samples.axes,
        keys=samples.keys,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        tied=samples.tied,
        plan=text,
    )
    write_manifest(store.tables_dir, table)
    return table


def rebuild(
    store: Store,
    solver: Solver,
    name: str = "default",
    *,
    more: Collection[str] = (),
    resolution: int | None = None,
    dtype: Precision | None = None,
) -> TableInfo:
    """Write a table of `solver` anew from the results that it was built of, and make it current; no run is repeated.

    A table that is here without them (`is_alone`) is written from its own spectra, with as many waves or fewer.

    What is not said stays: `resolution` and `dtype` of the current generation, even where its file is damaged. `more`
    names results to add. A `resolution` above that of the runs means theirs.

    Raises:
        UnknownTable: there is none of that name.
        CorruptTable: its manifest is damaged, so that nobody knows what it was built of; or it is without its runs, and
            damaged.
        MixedSamples: it is another solver's, or the results to add differ from the others in more than their axes.
        UnknownJob: a result is gone, or all are, and more is wanted than the table holds.
        CorruptShard: a result is damaged.
        StorageFull: the disk is full; the old generation stays current.

    """
    with _turn(store, name):
        now = info(store, name)
        if now.solver != solver.name:
            said = f"table {name!r} is of {now.solver}, not of {solver.name}."
            raise MixedSamples(said, "Build one under another name.")
        precision: Precision = dtype or cast(Precision, now.dtype)
        band = resolution or now.resolution
        if is_alone(store, now):
            source = _own(store, now, band, more)
        else:
            source = generate.results(store, collect(store, solver.name, now.places, Choice(keys={*now.keys, *more})))
        return _write(store, solver, name, source, band, precision, now.plan)


def is_alone(store: Store, table: TableInfo) -> bool:
    """Return whether none of a table's runs is stored, but for the one whose pattern they start from: so are the tables
    that come with wizen.
    """
    origin = (table.template.get("pattern") or {}).get("key")
    return not any(store.has(key) for key in table.keys if key != origin)


def _own(store: Store, table: TableInfo, band: int, more: Collection[str]) -> generate.Source:
    """Return a table that is alone as the source of its next generation.

    Raises:
        UnknownJob: what is wanted is not in it.
        CorruptTable: it is damaged.

    """
    path = path_of(store, table)
    if more:
        check_grows(store, table)
    if band > table.resolution:
        raise _alone(UnknownJob, store, table, "and without them it gets no more waves than it holds")
    if not path.is_file() or not seal.is_whole(path):
        raise _alone(CorruptTable, store, table, f"and {path} is damaged")
    return own.source(path, table)


def check_grows(store: Store, table: TableInfo) -> None:
    """Refuse a table that gets no more samples than it holds.

    Raises:
        UnknownJob: none of its runs is here.

    """
    if is_alone(store, table):
        raise _alone(UnknownJob, store, table, "and without them it gets no more samples than it holds")


def _alone(kind: type[StoreError], store: Store, table: TableInfo, why: str) -> StoreError:
    advice = f"`wizen table plan {table.name} --store {store.root}` prints the plan that makes them."
    return kind(f"table {table.name!r} is here without its runs, {why}.", advice if table.plan else "")


def _bounds(values: Iterable[float]) -> tuple[float, float]:
    known = list(values)
    return min(known), max(known)


def info(store: Store, name: str = "default") -> TableInfo:
    """Return what the current generation of a table is.

    Raises:
        UnknownTable: there is none of that name.
        CorruptTable: its manifest is damaged.

    """
    return read_manifest(store.tables_dir, name)


def path_of(store: Store, table: TableInfo) -> Path:
    """Return the generation file of a table."""
    return directory(store.tables_dir, table.name) / table.file


def open(store: Store, name: str = "default") -> xr.Dataset:
    """Open the current generation of a table, lazily; close it after use.

    Raises:
        UnknownTable: there is none of that name.
        CorruptTable: it cannot be read.

    """
    return generation.open(path_of(store, info(store, name)))


def prune(store: Store, name: str = "default") -> list[Path]:
    """Delete the generations of a table that are not current; return their paths. Open readers keep theirs.

    Raises:
        UnknownTable: there is none of that name.
        CorruptTable: its manifest is damaged, so that nobody knows which generation is current.

    """
    with _turn(store, name):
        current = path_of(store, info(store, name))
        old = [path for path in sorted(current.parent.glob("*.h5")) if path != current]
        for path in old:
            path.unlink(missing_ok=True)
    return old
