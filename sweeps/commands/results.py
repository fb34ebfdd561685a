"""`wizen results` and `wizen show`: what a store holds, and one result of it."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InvalidOption
from .terminal.console import emit, note
from .terminal.options import As_json, StorePath, check_place

if TYPE_CHECKING:
    from store.errors import CorruptShard

    from ..results import Row

__all__ = ["add_to"]

#: Numbers of a row that are shown to people unless they choose: more do not fit a line.
_SHOWN = 6


def add_to(app: typer.Typer) -> None:
    """Add these commands to the `wizen` command."""
    app.command()(results)
    app.command()(show)


def results(
    store: StorePath,
    solver: Annotated[str | None, typer.Option("--solver", help="Only results of this solver.")] = None,
    where: Annotated[
        list[str] | None, typer.Option("--where", metavar="NAME<VALUE", help="A condition, e.g. te<0.03. Repeatable.")
    ] = None,
    sort: Annotated[str | None, typer.Option("--sort", help="A name; -NAME puts the largest first.")] = None,
    last: Annotated[bool, typer.Option("--last", help="Of each run, its last stage alone.")] = False,
    names: Annotated[str | None, typer.Option("--columns", metavar="NAME,...", help="What to show.")] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values.")] = False,
    nc: Annotated[Path | None, typer.Option("--nc", metavar="FILE", help="Write netCDF for xarray.")] = None,
    as_json: As_json = False,
) -> None:
    """List the results of a store: one row per stage of each run, with its parameters and its numbers.

    Damaged results are named and left out; the exit code is 1 then.

    [bold]Examples[/bold]

    wizen results --store demo --where 'te<0.035' --sort=-roughness

    wizen results --store demo --solver growth --last --csv > growth.csv

    wizen results --store demo --nc demo.nc
    """
    from solver import registry
    from store.store import Store

    from .. import results as found

    if nc is not None:
        check_place("--nc", nc)
    damaged: dict[str, CorruptShard] = {}
    rows = found.find(Store.open(store), solver, where or (), sort, last, damaged)
    for error in damaged.values():
        note(f"left out: {error}")
    if solver is not None and not rows:
        registry.get(solver)  # results of a solver that is gone are still listed
    known = found.columns(rows)
    chosen = known if names is None else [name.strip() for name in names.split(",")]
    unknown = [name for name in chosen if rows and name not in known]
    if unknown:
        raise InvalidOption(f"--columns: no result has {unknown[0]!r}.", f"Known: {', '.join(known)}.")
    if nc is not None:
        from store import seal

        seal.publish(nc, found.dataset(rows)[chosen].to_netcdf(engine="h5netcdf"))
    if as_csv:
        writer = csv.writer(sys.stdout)
        writer.writerow(chosen)
        writer.writerows([row.values.get(name, "") for name in chosen] for row in rows)
    else:
        listed = [{n: _plain(row.values[n]) for n in chosen if n in row.values} for row in rows]
        document = {"results": listed, "count": len(rows), "damaged": sorted(damaged)}
        asked = found.named(where or (), sort)
        told = chosen if names is not None else _telling(rows, [name for name in asked if name in known])
        emit(document, as_json, lambda console: _show(console, rows, known, told))
    if damaged:
        raise typer.Exit(1)


def _plain(value: Any) -> Any:
    """Return a value as JSON has it, which knows no NaN."""
    return None if value != value else value


def _show(console: Any, rows: list[Row], known: list[str], columns: list[str]) -> None:
    # not a grid, which cuts what does not fit: keys are there to be copied
    lines = [columns, *([_cell(name, row.values.get(name)) for name in columns] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        text = "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        console.print(text.rstrip(), markup=False)
    left_out = len(known) - len(columns)
    more = f"; {left_out} more columns with --csv, --json or --columns" if left_out else ""
    console.print(f"{len(rows)} rows of {len({row.key for row in rows})} results{more}", markup=False)


def show(
    result: Annotated[str, typer.Argument(metavar="KEY", help="A key, or its first characters.")],
    store: StorePath,
    as_json: As_json = False,
) -> None:
    """Show one stored result: what was asked, by which version, and the numbers of each stage.

    [bold]Examples[/bold]

    wizen show 3fa9 --store demo
    """
    import json

    from store.store import Store

    from ..results import resolve
    from .terminal.words import per_stage, short, show_run

    opened = Store.open(store)
    key = resolve(opened, result)
    run, path = opened.get(key), opened.shard_path(key)
    params = json.loads(run.attrs["params"])
    document = {
        "key": key,
        "solver": run.attrs["solver"],
        "version": run.attrs["solver_version"],
        "params": params,
        "need": json.loads(run.attrs["need"]),
        "digest": run.attrs["digest"],
        "note": run.attrs.get("note"),
        "path": str(path),
        "bytes": path.stat().st_size,
        # each stage's are those spent up to it
        "seconds": float(run["seconds"].max()) if "seconds" in run else 0.0,
        "stages": [float(stage) for stage in run["stage"]],
        "fields": {str(n): {"dims": list(v.dims), "shape": list(v.shape)} for n, v in run.data_vars.items()},
        "descriptors": per_stage(run),
    }

    def shown(console: Any) -> None:
        console.print(f"{document['solver']} version {document['version']}", markup=False)
        console.print("  ".join(f"{name}={short(value)}" for name, value in params.items()), markup=False)
        fields = [name for name, said in document["fields"].items() if len(said["dims"]) > 1]
        console.print(f"fields: {', '.join(fields) or 'none'}", markup=False)
        show_run(console, document, str(run["stage"].attrs.get("symbol", "stage")))

    emit(document, as_json, shown)


def _telling(rows: list[Row], asked: list[str]) -> list[str]:
    """Return the columns that tell the rows apart, those that were asked about, and the first of their numbers."""
    params = {name: {row.params.get(name) for row in rows} for row in rows for name in row.params}
    numbers = dict.fromkeys(name for row in rows for name in row.numbers)
    solvers = ["solver"] if len({row.solver for row in rows}) > 1 else []
    varying = [name for name, values in params.items() if len(values) > 1]
    first = ["key", *solvers, *varying, "stage"]
    about = [name for name in asked if name not in first]
    left = [name for name in numbers if name not in about]
    return [*first, *about, *left[: max(_SHOWN - len(about), 0)]]


def _cell(name: str, value: Any) -> str:
    if name == "key":
        return str(value)[:12]
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)
