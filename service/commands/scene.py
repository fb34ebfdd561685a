"""`wizen scene`: a scene file as GLB or USD."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sweeps.commands.terminal.console import emit, grid, note
from sweeps.commands.terminal.options import As_json, StoreToRead
from sweeps.errors import InvalidOption

if TYPE_CHECKING:
    from ..shapes.live import LiveTables

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(scene)


def scene(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Camera, items, places and budget.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="scene.glb, .usdc or .usda; without, the report alone.")
    ] = None,
    store: StoreToRead = None,
    plain: Annotated[
        bool, typer.Option("--plain", help="GLB without EXT_meshopt_compression, for readers that lack it.")
    ] = False,
    as_json: As_json = False,
) -> None:
    """Put many fruits into one file: every distinct shape once, as fine as the camera can see, within a budget.

    The report says for each item what was computed, shared, reduced and left out, and why.

    [bold]Examples[/bold]

    wizen scene examples/scenes/bowl.toml --out bowl.glb

    wizen scene examples/scenes/bowl.toml --out bowl.usdc

    wizen scene examples/scenes/bowl.toml --json
    """
    import tomllib

    from store import seal

    from ..scenes.compose import make
    from ..scenes.request import FORMATS, parse
    from ..settings import Settings

    formats = {suffix: name for name, (_, suffix) in FORMATS.items() if name != "json"}
    if out is not None and out.suffix not in formats:
        raise InvalidOption(f"--out {out}: no scene is written as {out.suffix!r}.", f"Take {', '.join(formats)}.")
    try:
        values = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidOption(f"{file} cannot be read: {error}.", "Name a scene file.") from None
    except tomllib.TOMLDecodeError as error:
        raise InvalidOption(f"{file} is not TOML: {error}.", "docs/scenes.md explains scene files.") from None
    understood = parse(values)
    if any(place.rule in ("bowl", "pile") for place in understood.places):
        note("letting things fall until they rest: a few hundred take some seconds")
    made = make(
        understood, _tables(store), Settings().max_resolution, formats[out.suffix] if out else "json", not plain
    )
    if out is not None:
        seal.publish(out, made.data)
    emit(
        {**made.report, "path": None if out is None else str(out)},
        as_json,
        lambda console: _show(console, made.report, out),
    )


def _tables(store: Path | None) -> LiveTables:
    from sweeps.commands.terminal.tables import open_store

    from ..shapes.live import LiveTables

    return LiveTables(open_store(store).root, 60.0)


def _show(console: Any, report: dict[str, Any], out: Path | None) -> None:
    rows = []
    for item in report["items"]:
        skipped = ", ".join(f"{count} {why}" for why, count in item["skipped"].items())
        lattices = ", ".join(f"{count} of {n}" for n, count in item["lattices"].items())
        computed = str(len(item["computed"]))
        rows.append([item["name"], f"{item['shown']} of {item['instances']}", lattices, computed, skipped])
    grid(console, ["item", "shown", "colatitudes", "computed", "left out"], rows)
    told = (
        f"{report['shown']} of {report['instances']} shown, {report['meshes']} meshes, {report['triangles']} triangles"
    )
    console.print(f"{told}; {report['milliseconds_saved']:g} ms of look-ups saved", markup=False)
    if out is not None:
        console.print(f"{report['bytes']} bytes written to {out}", markup=False)
