"""`wizen scene`: a scene file as GLB or USD."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sweeps.commands.terminal.console import emit, grid, note
from sweeps.commands.terminal.options import As_json, StoreToRead, check_place
from sweeps.errors import InvalidOption

if TYPE_CHECKING:
    from ..scenes.kinds import Runs
    from ..scenes.request import Scene
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
    solve: Annotated[
        bool, typer.Option("--solve", help="Solve the runs that are missing first, and keep them in the store.")
    ] = False,
    as_json: As_json = False,
) -> None:
    """Put many things into one file: every distinct shape once, as fine as the camera can see, within a budget.

    Items are looked up in tables, or are stages of stored runs; something plain stands in for runs that are missing.
    The report says for each item what was computed, shared, reduced and left out, and why.

    [bold]Examples[/bold]

    wizen scene examples/scenes/bowl.toml --out bowl.glb

    wizen scene examples/scenes/bowl.toml --out bowl.usdc

    wizen scene examples/scenes/bowl.toml --json

    wizen scene examples/scenes/kitchen.toml --store kitchen --solve --out kitchen.glb
    """
    from store import seal

    from ..scenes.compose import make
    from ..scenes.request import FORMATS, parse

    formats = {suffix: name for name, (_, suffix) in FORMATS.items() if name != "json"}
    if out is not None and out.suffix.lower() not in formats:
        raise InvalidOption(f"--out {out}: no scene is written as {out.suffix!r}.", f"Take {', '.join(formats)}.")
    if out is not None:
        check_place("--out", out)
    understood = parse(_with_files(_toml(file), file.parent))
    to = formats[out.suffix.lower()] if out else "json"
    if solve:
        store = _own(store)
        _solve(understood, store)
    if any(place.rule in ("bowl", "pile") for place in understood.places):
        note("letting things fall until they rest: a few hundred take some seconds")
    made = make(understood, *_found(store), to, not plain, _runs(store))
    if out is not None:
        seal.publish(out, made.data)
    emit(
        {**made.report, "path": None if out is None else str(out)},
        as_json,
        lambda console: _show(console, made.report, out),
    )


def _toml(file: Path) -> dict[str, Any]:
    """Return what a TOML file says.

    Raises:
        InvalidOption: it cannot be read, or is none.

    """
    import tomllib

    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidOption(f"{file} cannot be read: {error.strerror}.", "Name a file that is there.") from None
    except UnicodeDecodeError:
        raise InvalidOption(f"{file} is not text in UTF-8.", "docs/scenes.md explains scene files.") from None
    except tomllib.TOMLDecodeError as error:
        raise InvalidOption(f"{file} is not TOML: {error}.", "docs/scenes.md explains scene files.") from None


def _with_files(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a scene with what it names files of, beside its own: parameters of items, and meshes of places.

    Raises:
        InvalidOption: there is no such file, or it is no mesh.

    """
    from sweeps.commands.terminal import meshfile
    from sweeps.commands.terminal.options import with_files

    items = values.get("items")
    for item in items if isinstance(items, list) else ():
        if isinstance(item, dict) and isinstance(item.get("params"), str):
            path, own = folder / item.pop("params"), item.get("parameters")
            read = with_files(_toml(path), path.parent)
            item["parameters"] = {**read, **(own if isinstance(own, dict) else {})}
    places = values.get("places")
    for place in places if isinstance(places, list) else ():
        if isinstance(place, dict) and isinstance(place.get("mesh"), str):
            place["mesh"] = meshfile.read(folder / place["mesh"])
    return values


def _found(root: Path | None) -> tuple[LiveTables, int]:
    """Return the tables of a store, the package's where it has none, and the finest lattice that is looked up."""
    from store import starter
    from sweeps.commands.terminal.tables import open_store

    from ..settings import Settings
    from ..shapes.live import LiveTables

    store = open_store(root)
    return LiveTables(store.root if store.table_names() else starter.ROOT, 60.0), Settings().max_resolution


def _runs(root: Path | None) -> Runs:
    """Return where runs are, and what is said of those that are not stored."""
    from sweeps.commands.terminal.tables import open_store

    from ..scenes.kinds import Runs

    advice = "Solve it with --solve" + (", in a store of your own: --store DIR." if root is None else ".")
    store = open_store(root)
    return Runs(lambda: store, lambda asked: (None, advice))


def _own(root: Path | None) -> Path:
    """Return where runs may be kept; a store is made there if there is none.

    Raises:
        ReadOnlyStore: no store of one's own is named.

    """
    from store import starter
    from store.store import Store

    starter.check_own(root or starter.ROOT)
    return Store.open(root or starter.ROOT, create=True).root


def _solve(scene: Scene, root: Path) -> None:
    """Solve the runs that a scene lacks, and keep them."""
    from store.store import Store
    from sweeps.commands.terminal import progress
    from sweeps.running import executors
    from sweeps.running.runner import run_jobs

    from ..scenes.kinds import distinct

    kinds, _ = distinct(scene.items, *_found(root), _runs(root))
    missing = {kind.missing.spec.key: kind.missing.spec for kind in kinds if kind.missing is not None}
    if not missing:
        return
    note(f"solving {len(missing)} runs that are missing")
    with executors.choose(None) as pool, progress.stopping(progress.GIVEN_BACK) as stop:
        with progress.sweep("scene", {}) as observe:
            run_jobs(missing.values(), Store.open(root), pool, "scene", observe, stop=stop)
        if stop.is_set():
            raise typer.Exit(130)


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
    for item in report["items"]:
        if "missing" in item:
            why, advice = item["missing"]["why"], item["missing"]["advice"]
            console.print(f"{item['name']}: {item['placeholder']} stands in: {why} {advice}", markup=False)
    if out is not None:
        console.print(f"{report['bytes']} bytes written to {out}", markup=False)
