"""The commands that keep tables: rebuild, verify, compare, prune. No run is needed but for spot checks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from ..errors import InvalidOption
from .terminal.console import emit, grid
from .terminal.options import As_json, StorePath, TableName

__all__ = ["add_to"]


def add_to(table_app: typer.Typer) -> None:
    """Add the commands of this module to `wizen table`."""
    table_app.command()(rebuild)
    table_app.command()(verify)
    table_app.command()(compare)
    table_app.command()(prune)


def rebuild(
    store: StorePath,
    name: TableName = "default",
    resolution: Annotated[
        int | None, typer.Option("--resolution", min=4, help="Waves to keep, and the grid that holds them.")
    ] = None,
    precision: Annotated[
        Literal["int16", "float32", "float64"] | None,
        typer.Option("--precision", help="float32, float64, or int16: packed, half to a tenth of float32's bytes."),
    ] = None,
    as_json: As_json = False,
) -> None:
    """Write a table anew from the runs that it was built of: another grid, band limit or precision; no run is repeated.

    What is not said stays as it is. The old generation serves until the new one is whole, and whoever has it open
    keeps it. `wizen table build` chooses runs; this keeps them. A table that came without its runs is written from its
    own waves: as many or fewer.

    [bold]Examples[/bold]

    wizen table rebuild --store demo --resolution 32

    wizen table rebuild --store demo --name exact --precision float64
    """
    from solver import registry
    from store import tables
    from store.checking import truncation
    from store.errors import CorruptTable
    from store.store import Store

    opened = Store.open(store)
    old = tables.info(opened, name)
    path, alone = tables.path_of(opened, old), tables.is_alone(opened, old)
    try:
        was = (path.stat().st_size, [] if alone else truncation.losses(opened, old)) if path.is_file() else None
    except CorruptTable:
        was = None
    new = tables.rebuild(opened, registry.get(old.solver), name, resolution=resolution, dtype=precision)
    size = tables.path_of(opened, new).stat().st_size
    lost = truncation.losses(opened, new, old if alone else None)

    def side(table: Any, size: int | None, losses: Any) -> dict[str, Any]:
        return {
            "digest": table.digest,
            "resolution": table.resolution,
            "precision": table.dtype,
            "samples": table.samples,
            "bytes": size,
            "truncation": [row._asdict() for row in losses or ()],
        }

    before, after = side(old, *(was or (None, None))), side(new, size, lost)
    document = {"table": name, "changed": old.digest != new.digest, "source": "table" if alone else "runs"}
    document |= {"before": before, "after": after}
    if resolution is not None and resolution > new.resolution:
        document["note"] = f"the runs hold {new.resolution} waves: the {resolution} asked for cannot be had of them"
    symbol = registry.get(old.solver).stages.symbol
    emit(document, as_json, lambda console: _show_rebuilt(console, document, symbol))


def _show_rebuilt(console: Any, document: dict[str, Any], symbol: str) -> None:
    before, after = document["before"], document["after"]
    console.print(f"table {document['table']}: rebuilt" + ("" if document["changed"] else ", and the same"))
    alone = document["source"] == "table"
    if alone:
        console.print("from its own spectra, as none of its runs is here; lost is what these lose")
    if "note" in document:
        console.print(document["note"], markup=False)
    rows = [
        ["digest", before["digest"][:16], after["digest"][:16]],
        *([word, str(before[word]), str(after[word])] for word in ("resolution", "precision", "samples")),
        ["size", _size(before["bytes"]), _size(after["bytes"])],
    ]
    lost = {row["stage"]: row for row in before["truncation"]}
    for row in after["truncation"]:
        gone = lost.get(row["stage"])
        then = f"{gone['rms']:.2g} (max {gone['max']:.2g})" if gone else "" if alone else "damaged"
        rows.append([f"lost at {symbol} = {row['stage']:g} [r1]", then, f"{row['rms']:.2g} (max {row['max']:.2g})"])
    grid(console, ["", "before", "after"], rows)


def verify(
    store: StorePath,
    name: TableName = "default",
    recompute: Annotated[int, typer.Option("--recompute", min=0, metavar="N", help="Solve N of its runs again.")] = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Which runs are solved again.")] = 0,
    tolerance: Annotated[
        float, typer.Option("--tolerance", min=0, help=r"Change of displacement \[r1] allowed to other machines.")
    ] = 0.0,
    as_json: As_json = False,
) -> None:
    """Check a table to the last byte, and every run behind it. Exit code 1 if anything is wrong.

    Manifest, seal, digest, variables, units, trust; each run's seal and digest, and that the table holds its waves.
    That none of the runs is here, as of the tables in the package, is said and is nothing wrong.

    [bold]Examples[/bold]

    wizen table verify --store demo

    wizen table verify --store demo --recompute 2
    """
    from store import tables
    from store.checking import audit
    from store.store import Store

    from ..recompute import recompute as solve_again
    from .terminal import progress

    opened = Store.open(store)
    findings = audit.verify(opened, name)
    spots: list[Any] = []
    if recompute and not any(finding.part == "manifest" for finding in findings):
        table = tables.info(opened, name)
        broken = {finding.name for finding in findings if finding.part == "result"}
        kept = [key for key in table.keys if key not in broken and not tables.is_alone(opened, table)]
        with progress.stopping() as stop:
            for found in solve_again(opened, table, kept, recompute, seed, tolerance, stop.is_set):
                known: list[Any] = findings if isinstance(found, audit.Finding) else spots
                known.append(found)
    sound = all(finding.remark for finding in findings)
    document = {
        "table": name,
        "sound": sound,
        "findings": [finding._asdict() for finding in findings],
        "recomputed": [spot._asdict() for spot in spots],
    }

    def show(console: Any) -> None:
        if findings:
            grid(console, ["part", "name", "finding"], [[f.part, f.name[:16], f.message] for f in findings])
        if sound:
            console.print(f"table {name} is sound", markup=False)
        for spot in spots:
            how = "the same bytes" if spot.same else f"displacement within {spot.apart:.2g} r1"
            console.print(f"solved again: {spot.key[:12]}: {how}", markup=False)

    emit(document, as_json, show)
    if not sound:
        raise typer.Exit(1)


def compare(
    a: Annotated[str, typer.Argument(metavar="A", help="A table's name, a generation (.h5), or a store's directory.")],
    b: Annotated[str, typer.Argument(metavar="B", help="What to compare with it.")],
    store: Annotated[
        Path | None, typer.Option("--store", metavar="DIR", envvar="WIZEN_STORE", help="Where A and B are names.")
    ] = None,
    name: TableName = "default",
    as_json: As_json = False,
) -> None:
    """Say how two tables differ: samples, and B against A in displacement and descriptors at every stage.

    A and B are names of tables in --store, generations (STORE/tables/NAME/DIGEST.h5), or stores, whose table --name is
    meant.

    [bold]Examples[/bold]

    wizen table compare default coarse --store demo

    wizen table compare cold-store continued-store

    wizen table compare demo/tables/default/0123456789abcdef.h5 demo
    """
    from store.checking import compare as comparing

    found = comparing.compare(_generation(a, store, name), _generation(b, store, name))

    def show(console: Any) -> None:
        same = "the same content" if found.equal else "different contents"
        console.print(
            f"{same}: {found.common} samples in both, {len(found.only_a)} only in A, {len(found.only_b)} only in B",
            markup=False,
        )
        rows = [
            [what, str(x), str(y)]
            for what, x, y in [
                ("digest", found.a.digest[:16], found.b.digest[:16]),
                ("solver", f"{found.a.solver} {found.a.version}", f"{found.b.solver} {found.b.version}"),
                ("samples", found.a.samples, found.b.samples),
                ("stages", len(found.a.stages), len(found.b.stages)),
                ("resolution", found.a.resolution, found.b.resolution),
                ("precision", found.a.dtype, found.b.dtype),
                ("size", _size(found.a.size), _size(found.b.size)),
                *((key, x, y) for key, (x, y) in found.fixed.items()),
            ]
        ]
        grid(console, ["", "A", "B"], rows)
        units = {row.of: row.units for row in found.differences}
        numbers = [[r.of, f"{r.stage:g}", f"{r.rms:.3g}", f"{r.max:.3g}", units[r.of]] for r in found.differences]
        if numbers:
            grid(console, ["B against A", "s", "rms", "max", "units"], numbers)

    emit(found.to_json(), as_json, show)


def prune(store: StorePath, name: TableName = "default", as_json: As_json = False) -> None:
    """Delete the generations of a table that are not current. Whoever has one open keeps it until it is closed.

    Each build, rebuild and round of `wizen refine` leaves one behind, for `wizen table compare`.

    [bold]Examples[/bold]

    wizen table prune --store demo
    """
    from store import starter, tables
    from store.manifest import directory
    from store.store import Store

    starter.check_own(store)
    opened = Store.open(store)
    sizes = {path: path.stat().st_size for path in directory(opened.tables_dir, name).glob("*.h5")}
    gone = tables.prune(opened, name)
    freed = sum(sizes.get(path, 0) for path in gone)
    document = {"table": name, "deleted": [path.name for path in gone], "bytes": freed}
    said = f"table {name}: {len(gone)} old generations deleted, {_size(freed)}"
    emit(document, as_json, lambda console: console.print(said, markup=False))


def _generation(text: str, store: Path | None, name: str) -> Path:
    """Return the generation file that a word on the command line means.

    Raises:
        InvalidOption: it means none.

    """
    from store import tables
    from store.store import Store

    path = Path(text)
    if path.suffix.lower() == ".h5":
        if not path.is_file():
            raise InvalidOption(f"there is no generation {text}.", "STORE/tables/NAME/ holds them.")
        return path
    if (path / "shards").is_dir():
        opened, name = Store.open(path), name
    elif store is not None:
        opened, name = Store.open(store), text
    else:
        raise InvalidOption(f"{text!r} is no store.", "Name the store in which it is a table: --store DIR.")
    return tables.path_of(opened, tables.info(opened, name))


def _size(size: int | None) -> str:
    return "damaged" if size is None else f"{size / 1e6:.3g} MB"
