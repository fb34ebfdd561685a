"""`wizen match`: the way back, from a shape to its parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sweeps.commands.terminal.console import emit, grid
from sweeps.commands.terminal.options import As_json, StoreToRead, assignments
from sweeps.errors import InvalidOption

if TYPE_CHECKING:
    from ..views.match import Match, MatchPage

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(match)


def match(
    target: Annotated[
        Path,
        typer.Option("--target", metavar="FILE", help="A mesh (.obj, .glb, .stl, .ply), a mask (.png), or .json."),
    ],
    size: Annotated[
        float | None,
        typer.Option("--size", help="Length of r1 in the target's unit (pixels of a mask); without, any size."),
    ] = None,
    known: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="What is known of it, e.g. te=0.035.")
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="The table to search; without, all.")] = None,
    store: StoreToRead = None,
    as_json: As_json = False,
) -> None:
    """Find the parameters and the stage whose shape comes nearest: same outline, roughness and spectrum, not the same
    wrinkles. A mesh may be turned, mirrored and moved, and of any size unless --size says it.

    A mask is a photograph's shape, white on black or on a transparent ground. JSON holds descriptors,
    {"roughness": 0.04, "volume": [0.62, 0.01]}, each a number or a number and its scatter.

    [bold]Examples[/bold]

    wizen match --target scan.obj

    wizen match --target scan.obj --size 7.5 --set te=0.035

    wizen match --target photo-mask.png --name default --json
    """
    from sweeps.commands.terminal.progress import one_run
    from sweeps.commands.terminal.tables import open_store

    from ..matching import answer, targets
    from ..shapes.live import LiveTables

    if target.suffix.lower() not in targets.KINDS:
        advice = f"Take {', '.join(targets.KINDS)}."
        raise InvalidOption(f"--target {target}: {target.suffix or 'no suffix'} is not matched.", advice)
    try:
        data = target.read_bytes()
    except OSError as error:
        raise InvalidOption(f"--target {target}: {error.strerror}.", "Name a file that you may read.") from None
    read = targets.read(data, target.suffix.lower(), size)
    with one_run("matching") as progress:
        page = answer.match(read, LiveTables(open_store(store).root, 60.0), name, _numbers(known), progress)
    emit(page.model_dump(), as_json, lambda console: _show(console, page))


def _numbers(known: list[str] | None) -> dict[str, float]:
    found = assignments(known)
    for name, value in found.items():
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise InvalidOption(f"--set {name}: {value!r} is no number.", "Write for example --set te=0.035.")
    return {name: float(value) for name, value in found.items()}


def _show(console: Any, page: MatchPage) -> None:
    rows = [_row(one) for one in (page.best, *page.alternatives[:5])]
    grid(console, ["table", "parameters", "stage", "distance", "by part"], rows)
    said = {True: "nothing else in the tables is as near", False: "not unique"}[page.unique]
    console.print(f"{page.grade}, {said}. {page.advice}", markup=False)
    console.print(page.best.command, markup=False)


def _row(one: Match) -> list[str]:
    sure = one.uncertainty
    places = [f"{name} {value:.4g}" + _give(sure.get(name)) for name, value in one.parameters.items()]
    parts = ", ".join(f"{name} {value:.2f}" for name, value in one.parts.items())
    stage = f"{one.symbol} {one.stage:.4g}" + _give(sure.get(one.symbol))
    return [one.table, ", ".join(places), stage, f"{one.distance:.2f}", parts]


def _give(deviation: float | None) -> str:
    return "" if deviation is None else f" +- {deviation:.2g}"
