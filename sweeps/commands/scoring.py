"""The command that scores a table's look-ups: against runs, and by their distance to equilibrium."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InvalidOption
from .terminal.console import emit, grid
from .terminal.options import As_json, StoreToRead, TableName, check_place

if TYPE_CHECKING:
    from store.lookup import ShapeTable
    from store.store import Store

    from ..refining.balance import Distance
    from ..refining.score import Report

__all__ = ["add_to"]

#: The picture's stage where none is named.
_STAGE = 0.2


def add_to(table_app: typer.Typer) -> None:
    """Add the command of this module to those about tables."""
    table_app.command()(score)


def score(
    store: StoreToRead = None,
    name: TableName = "default",
    held_out: Annotated[
        Path | None,
        typer.Option("--held-out", metavar="PLAN|STORE", help="Runs to predict; without, each sample from the others."),
    ] = None,
    methods_: Annotated[str | None, typer.Option("--methods", metavar="M,M,...", help="Only these methods.")] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE.png", help="Truth, the paper's and the default.")
    ] = None,
    stage: Annotated[float | None, typer.Option("--stage", help="The picture's: the stored one next to it.")] = None,
    relax: Annotated[
        int, typer.Option("--relax", min=0, metavar="COUNT", help="Relax what is looked up at so many random points.")
    ] = 0,
    as_json: As_json = False,
) -> None:
    r"""Score the look-up methods by stage: against runs that the table has not seen, or leaving out its own.

    rgh: roughness over the true one. dB: error of band powers. W1: slopes' distributions \[degree]. patch: variation of
    local slope energy. L2nr, ang \[degree] and corr: point by point. The method "seed" is the floor: how two runs
    differ whose seeds alone do.

    With --relax also the distance to equilibrium: the residual of a looked-up shape on the solver's mesh, how far
    the solver moves it (rms over its roughness) until it is in balance, and how its roughness, bands and slopes compare
    with what becomes of it. Fruits keep the pattern that their runs start from, if the store holds its run.

    [bold]Examples[/bold]

    wizen table score --store demo

    wizen table score --store demo --held-out held.toml --picture score.png

    wizen table score --store demo --held-out other-store --methods idw,linear+LL+env --json

    wizen table score --name stone-radius --methods idw,linear+LL+env --relax 1
    """
    from solver import registry
    from store import seal, starter
    from store.blending import methods
    from store.lookup import ShapeTable
    from store.store import Store

    from ..refining import score as scores

    _check(picture, stage)
    names = methods.NAMED if methods_ is None else [str(methods.parse(part)) for part in methods_.split(",")]
    opened = Store.open(store or starter.ROOT)
    table = ShapeTable.open(opened, name, surfaces=registry.surface)
    cases, pairs = scores.cases(opened, table, held_out)
    report = scores.score(table, cases, pairs, names, held_out is not None)
    if picture is not None:
        near = min(table.stages, key=lambda stored: abs(stored - (_STAGE if stage is None else stage)))
        seal.publish(picture, scores.picture(cases, near))
    document = {"table": name, "digest": table.digest, **report.to_json(), "default": methods.DEFAULT}
    moved = list(_distances(table, names, relax, begun := _begun(table, opened)))
    if relax:
        document |= {"relaxed": [row.to_json() for row in moved], "with_pattern": begun is not None}
    symbol = registry.get(table.info.solver).stages.symbol
    emit(document, as_json, lambda console: _show(console, name, report, moved, symbol, picture))


def _check(picture: Path | None, stage: float | None) -> None:
    """Refuse, before any work, a picture that is none or could not be written, and a stage without one."""
    if picture is None:
        if stage is not None:
            raise InvalidOption("--stage is the picture's.", "Name it: --picture score.png; all stages are scored.")
        return
    if picture.suffix.lower() != ".png":
        raise InvalidOption(f"--picture {picture}: it is a picture.", "Name it .png.")
    check_place("--picture", picture)


def _show(console: Any, name: str, report: Any, moved: list[Any], symbol: str, picture: Path | None) -> None:
    from store.blending import methods

    _show_score(console, name, report, methods.DEFAULT, symbol)
    if moved:
        _show_distances(console, moved, symbol)
    if picture is not None:
        console.print(f"drawn to {picture}", markup=False)


def _begun(table: ShapeTable, store: Store) -> Store | None:
    """Return the store if it has all that the table's runs begin with."""
    from ..refining import balance

    return store if balance.at_hand(table, store) else None


def _distances(table: ShapeTable, names: Sequence[str], count: int, store: Store | None) -> Iterator[Distance]:
    """Yield the mean distance to equilibrium of each method at each stage, and say how far that is."""
    from solver import registry

    from ..refining import balance

    solver = registry.get(table.info.solver)
    points = balance.between(table, count) if count else []
    if points and store is None:
        typer.echo("relaxed without the pattern that their runs start from: the store does not hold it", err=True)
    for name, stage in itertools.product(names if points else (), table.stages):
        found = [balance.distance(solver, table, values, stage, name, store) for values in points]
        rows = [row for row in found if row is not None]
        typer.echo(f"relaxed {len(rows)} of {len(points)}: {name}, stage {stage:g}", err=True)
        if rows:
            yield balance.mean(rows)


def _show_distances(console: Any, rows: Sequence[Distance], symbol: str) -> None:
    console.print("relaxed until in balance, looked up over what became of it:", markup=False)
    names = [name for name in rows[0].to_json() if name not in ("method", "stage")]
    cells = [[row.method, f"{row.stage:g}", *(f"{row.to_json()[name]:.3g}" for name in names)] for row in rows]
    grid(console, ["method", symbol, *names], cells)


def _show_score(console: Any, name: str, report: Report, default: str, symbol: str) -> None:
    kind = "held-out runs" if report.held_out else "samples, each predicted from the others"
    console.print(f"table {name}: {len(report.labels)} {kind}; {report.seeds} pairs of seeds; * default", markup=False)
    rows = [
        [row.method + " *" * (row.method == default), f"{row.stage:g}"] + [f"{value:.3g}" for value in row.measures]
        for row in report.rows
    ]
    grid(console, ["method", symbol, *report.rows[0].measures._fields], rows)
    likeness = [[f"{s:g}", f"{value:.3f}"] for s, value in report.correlation.items()]
    grid(console, [symbol, "correlation of neighbours"], likeness)
