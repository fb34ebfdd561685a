"""The commands about tables: build, info and score; `cli_tools` holds those that keep them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ..errors import InvalidOption
from . import care as cli_tools
from . import scoring
from .terminal.console import emit, grid
from .terminal.options import As_json, Quality, StorePath, StoreToRead, TableName, check_place
from .terminal.tables import open_store

if TYPE_CHECKING:
    import xarray as xr

    from store.store import Store

    from ..planning.plan import Plan

__all__ = ["add_to"]

table_app = typer.Typer(no_args_is_help=True, help="Build, keep, check, compare and describe look-up tables.")


def add_to(app: typer.Typer) -> None:
    """Add the commands of this module to the root command."""
    cli_tools.add_to(table_app)
    scoring.add_to(table_app)
    app.add_typer(table_app, name="table")


@table_app.command()
def build(
    store: StorePath,
    name: TableName = "default",
    solver: Annotated[str | None, typer.Option("--solver", help="Whose results, if not of one solver.")] = None,
    plan: Annotated[
        str | None, typer.Option("--plan", help="Only the results of this plan: its name, or its file.")
    ] = None,
    quality: Quality = None,
    version: Annotated[str | None, typer.Option("--version", help="Only the results of this solver version.")] = None,
    resolution: Annotated[int | None, typer.Option("--resolution", min=4, help="Cut the spectra to this band.")] = None,
    precision: Annotated[
        Literal["int16", "float32", "float64"], typer.Option("--precision", help="As for `table rebuild`.")
    ] = "float32",
    as_json: As_json = False,
) -> None:
    """Build a table from the finished runs in a store, and make it the current one.

    Runs of a solver whose fresh surface is known make a table of shapes, to be looked up. Runs of any solver make a
    table of numbers, scalars.nc, that opens in xarray: descriptors by stage over all that varies between the runs.

    [bold]Examples[/bold]

    wizen table build --store demo

    wizen table build --store demo --name coarse --plan fig7-right --resolution 32
    """
    from solver import registry
    from store import scalars, tables
    from store.errors import EmptyTable
    from store.generations.samples import Choice, finished, is_surface
    from store.store import Store

    opened = Store.open(store)
    read, text = _plan(opened, plan)
    if read is not None:
        plan, solver = read.name, solver or read.solver.name
    keys = _runs_of(opened, read) if read is not None else None
    chosen = registry.get(solver or _only_solver(opened, plan))
    made = None
    choice = Choice(plan, quality, version, keys)
    if chosen.surface is not None and finished(opened, chosen.name, choice, is_surface):
        told: dict[str, Any] = {"resolution": resolution, "text": text, "dtype": precision}
        made = tables.build(opened, chosen, name, **choice._asdict(), **told)
    elif resolution is not None:
        raise InvalidOption("--resolution cuts shapes, and there are none.", "Leave it out.")
    numbers: dict[str, Any] | None = None
    try:
        path = scalars.build(opened, chosen, name, choice._replace(keys=made.keys if made else choice.keys))
        numbers = _numbers(scalars.read(opened, name), path)
    except EmptyTable:
        if made is None:  # shapes alone, without a number beside them, are a table as well
            raise
    if made is not None:
        _show_table(made, tables.path_of(opened, made), as_json, numbers)
    elif numbers is not None:
        found = numbers
        emit({"name": name, "scalars": found}, as_json, lambda console: _show_numbers(console, name, found))


@table_app.command("list")
def list_(
    store: StoreToRead = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE.png", help="A picture of each, side by side.")
    ] = None,
    as_json: As_json = False,
) -> None:
    """List the tables of shapes: what each covers, how good it is, which presets it holds.

    [bold]Examples[/bold]

    wizen table list

    wizen table list --picture fruits.png

    wizen table list --store demo --json
    """
    from solver import registry
    from store import seal, tables
    from store.families import stored

    from ..families import covered, gallery

    opened = open_store(store)
    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise InvalidOption(f"--picture {picture}: it is a picture.", "Name it .png.")
        check_place("--picture", picture)
    found = []
    for name in opened.table_names():
        table = tables.info(opened, name)
        solver = registry.get(table.solver)
        found.append(covered(opened, stored.families(opened, solver), table, solver))

    if picture is not None:
        seal.publish(picture, gallery(opened))

    def show(console: Any) -> None:
        rows = []
        for one in found:
            axes = "; ".join(f"{axis} {_spanned(said['values'])}" for axis, said in one["axes"].items())
            stages = _spanned([said["stage"] for said in one["stages"]])
            good = sum(said["converged"] or 0 for said in one["stages"])
            rows.append(
                [
                    one["name"],
                    axes,
                    stages,
                    f"{good}/{one['samples'] * len(one['stages'])}",
                    str(one["quality"]),
                    f"{one['solver']} {one['version']}",
                    ", ".join(one["presets"]),
                    f"{one['bytes'] / 1e6:.1f}",
                ]
            )
        grid(console, ["table", "axes", "stages", "converged", "quality", "version", "presets", "MB"], rows)

    emit({"tables": found}, as_json, show)


def _spanned(values: Sequence[float]) -> str:
    """Return values for people: all of a few, else the ends and how many there are."""
    if len(values) <= 2:
        return ", ".join(f"{value:g}" for value in values)
    return f"{min(values):g}..{max(values):g} ({len(values)})"


@table_app.command("plan")
def plan_(name: Annotated[str, typer.Argument(help="Name of the table.")], store: StoreToRead = None) -> None:
    """Print the plan that a table was made from, so that anybody can make the rest of it, or all of it again.

    [bold]Examples[/bold]

    wizen table plan sphere-02 > sphere.toml
    """
    from store import tables
    from store.errors import UnknownTable

    text = tables.info(open_store(store), name).plan
    if not text:
        raise UnknownTable(
            f"nobody kept the plan of table {name!r}.", "Build it again with --plan and the plan's file."
        )
    typer.echo(text, nl=not text.endswith("\n"))


@table_app.command()
def info(store: StoreToRead = None, name: TableName = "default", as_json: As_json = False) -> None:
    """Say what a table holds: its axes with bounds, what is fixed, its stages.

    [bold]Examples[/bold]

    wizen table info --store demo

    wizen table info --store demo --name coarse --json
    """
    from store import scalars, starter, tables
    from store.store import Store

    opened = Store.open(store or starter.ROOT)
    path = scalars.path_of(opened, name)
    numbers = _numbers(scalars.read(opened, name), path) if path.is_file() else None
    if numbers is not None and name not in opened.table_names():
        emit({"name": name, "scalars": numbers}, as_json, lambda console: _show_numbers(console, name, numbers))
        return
    found = tables.info(opened, name)
    _show_table(found, tables.path_of(opened, found), as_json, numbers)


def _only_solver(store: Store, plan: str | None) -> str:
    """Return the one solver whose results a store holds.

    Raises:
        EmptyTable: there are none.
        InvalidOption: there are several solvers'.

    """
    from store.errors import EmptyTable

    store.learn()
    found = {job.solver for job in store.ledger.jobs("done", plan)}
    if not found:
        where = f"plan {plan!r} has" if plan else "the store holds"
        raise EmptyTable(f"{where} no finished run to build a table from.", "Run a sweep first: wizen sweep PLAN.")
    if len(found) > 1:
        raise InvalidOption(f"there are results of {', '.join(sorted(found))}.", "Say whose: --solver NAME.")
    return found.pop()


def _numbers(table: xr.Dataset, path: Path) -> dict[str, Any]:
    """Return what a table of numbers holds, as plain values."""
    dims = {str(dim): size for dim, size in table.sizes.items()}
    own = {str(axis): table[axis].values.tolist() for axis in dims if axis in table.coords and axis != "component"}
    return {
        "path": str(path),
        "digest": table.attrs["digest"],
        "solver": table.attrs["solver"],
        "sizes": dims,
        "axes": own,
        "variables": sorted(map(str, table.data_vars)),
    }


def _show_numbers(console: Any, name: str, numbers: dict[str, Any]) -> None:
    over = " x ".join(f"{dim} ({size})" for dim, size in numbers["sizes"].items())
    console.print(f"table {name}: {len(numbers['variables'])} numbers of {numbers['solver']} over {over}", markup=False)
    console.print(", ".join(numbers["variables"]), markup=False)
    console.print(numbers["path"], markup=False)


def _plan(store: Store, plan: str | None) -> tuple[Plan | None, str]:
    """Return the plan in a file, if it is one, and the text of that, or of the plan of that name."""
    if plan is None or not plan.endswith(".toml"):
        return None, store.plan(plan) if plan is not None else ""
    from ..planning.plan import Plan

    return Plan.read(plan)


def _runs_of(store: Store, plan: Plan) -> tuple[str, ...]:
    """Return the stored runs of a plan as its file is now: what was swept under its name before may have been more.

    Where there is none of the solver's version, those of others are taken, and what their parameters start from is of
    these, too.

    Raises:
        EmptyTable: no such run is stored.

    """
    from store.errors import EmptyTable

    asked = list(plan.jobs())
    if keys := tuple(job.key for job in asked if store.has(job.key)):
        return keys
    wanted = {_without_keys(job.params) for job in asked}
    done = [job for job in store.ledger.jobs("done", plan.name) if _without_keys(job.params) in wanted]
    if keys := tuple(job.key for job in done if store.has(job.key)):
        return keys
    raise EmptyTable(
        f"no run of plan {plan.name!r} as its file is now is stored.",
        "Sweep it first; --plan with its name alone takes what was swept under that before.",
    )


def _without_keys(params: Mapping[str, Any]) -> bytes:
    """Return parameters without the runs that they start from."""
    from store.canonical import canonical

    told = {
        name: {part: each for part, each in value.items() if part != "key"} if isinstance(value, Mapping) else value
        for name, value in params.items()
    }
    return canonical(told)


def _show_table(table: Any, path: Path, as_json: bool, numbers: dict[str, Any] | None) -> None:
    document = table.to_json() | {"path": str(path)} | ({"scalars": numbers} if numbers else {})

    def show(console: Any) -> None:
        console.print(f"table {table.name}: {table.samples} samples of {table.solver}, digest {table.digest[:16]}")
        rows = [(axis, f"{low:g} to {high:g}") for axis, (low, high) in table.axes.items()]
        rows.append(("stages", ", ".join(f"{stage:g}" for stage in table.stages)))
        rows.append(("resolution", str(table.resolution)))
        grid(console, ("axis", "values"), rows)
        console.print(str(path), markup=False)
        if numbers is not None:
            _show_numbers(console, table.name, numbers)

    emit(document, as_json, show)
