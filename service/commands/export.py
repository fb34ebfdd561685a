"""`wizen export`: a stored result, or a result file, as what other programs read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sweeps.commands.terminal.console import emit, note
from sweeps.commands.terminal.grouped import grouped
from sweeps.commands.terminal.options import As_json
from sweeps.errors import InvalidOption

if TYPE_CHECKING:
    import xarray as xr

    from ..sequences import Export, Options, Sequence
    from ..sequences.imported import Bound

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(export)


@dataclass(frozen=True)
class _Asked:
    """What `wizen export` is told; left out, options are the formats' own."""

    result: Annotated[str, typer.Argument(metavar="KEY|FILE.h5", help="A key (or its beginning), or a result file.")]
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Where it goes; the suffix says how.")] = (
        None
    )
    format: Annotated[str | None, typer.Option("--format", help="Named format, where the suffix does not say.")] = None
    store: Annotated[
        Path | None, typer.Option("--store", metavar="DIR", envvar="WIZEN_STORE", help="The store that has the key.")
    ] = None
    stage: Annotated[float | None, typer.Option("--stage", help="One stage in place of all.")] = None
    colour: Annotated[
        str | None, typer.Option("--colour", help="auto (skin, rot, mould), none, or a field's name.")
    ] = None
    textures: Annotated[int | None, typer.Option("--textures", help="GLB, USDZ: colours as pictures of N pixels.")] = (
        None
    )
    threads: Annotated[
        int | None,
        typer.Option("--threads", help="GLB, USD: N threads of a decay's mould at most, cards or curves."),
    ] = None
    full: Annotated[
        bool, typer.Option("--full", help="GLB, USD: threads, stem and calyx; GLB, USDZ: fine pictures of the skin.")
    ] = False
    cut: Annotated[
        str | None,
        typer.Option(
            "--cut", metavar="X,Y,Z,NX,NY,NZ", help="Cut open: a point, and the normal to the half that goes."
        ),
    ] = None
    map_: Annotated[str | None, typer.Option("--map", help="PNG, EXR: which field.")] = None
    size: Annotated[int | None, typer.Option("--size", help="PNG, EXR: pixels along and down (512).")] = None
    low: Annotated[float | None, typer.Option("--low", help="PNG: value shown as 0.")] = None
    high: Annotated[float | None, typer.Option("--high", help="PNG: value shown as 65535.")] = None
    scale: Annotated[
        float | None, typer.Option("--scale", help="Length in the file of the result's unit, e.g. 0.035.")
    ] = None
    fps: Annotated[float | None, typer.Option("--fps", help="Frames per second (24).")] = None
    step: Annotated[float | None, typer.Option("--step", help="Frames from stage to stage (12).")] = None
    mesh: Annotated[
        Path | None,
        typer.Option("--mesh", metavar="MESH", help="PC2, MDD: your own mesh, to be moved (OBJ, PLY, GLB, STL)."),
    ] = None
    binding: Annotated[
        str | None, typer.Option("--binding", help="How MESH is tied: nearest, or direction (fruits).")
    ] = None
    fit: Annotated[str, typer.Option("--fit", help="box lays MESH on the result, none leaves it where it is.")] = "box"
    as_json: As_json = False


#: Options that the formats know by the same names.
_SHARED = ("colour", "cut", "full", "textures", "threads", "size", "low", "high", "scale", "fps", "step")


@grouped(_Asked)
def export(asked: _Asked) -> None:
    """Write a result for Blender, Houdini, Maya, 3ds Max or a browser. docs/formats.md shows how to open each.

    All stages: .glb (animated), .usdc, .usda, .usdz (with textures), .pc2, .mdd, .ply.zip, .obj.zip. One stage, the
    last unless --stage says which: .obj, .ply, .png (16-bit map of a field) and .exr (maps of all). Caches move a mesh
    with the result's own vertices: write it with --stage FIRST --out fruit.obj.

    [bold]Examples[/bold]

    wizen solve decay --preset orange --stages 0,4,8 --out run.h5

    wizen export run.h5 --out orange.glb --full

    wizen export run.h5 --out rot.png --map rot --size 512 --stage 8

    wizen export 3fa9 --store demo --out plum.usdc --scale 0.02

    wizen export run.h5 --cut 0,0,0,0,0,1 --out inside.glb

    wizen export run.h5 --mesh my.obj --format pc2
    """
    from sweeps.commands.terminal import progress

    from ..sequences import Options, prepared

    chosen, out = _format(asked.format, asked.out, asked.result)
    run = _shown(_read(asked.result, asked.store))
    options = Options.parse({"map": asked.map_, **{name: getattr(asked, name) for name in _SHARED}})
    _warn_of_threads(run, asked.threads)
    sequence = prepared(run, options, asked.stage, chosen is None or chosen.single)
    bound = None
    with progress.one_run("export") as observe:
        sequence = replace(sequence, observe=lambda share: observe(share, _counted(round(share * len(sequence)))))
        if asked.mesh is None:
            data = _written(sequence, chosen, options)
        else:
            bound = _bound(asked.mesh, run, options, asked.binding, asked.fit)
            data = _moved(bound, sequence, chosen, options)
    from store import seal

    seal.publish(out, data)
    document: dict[str, Any] = {
        "path": str(out),
        "format": chosen.name if chosen else "obj",
        "bytes": len(data),
        "vertices": sequence.samples if bound is None else len(sequence) * len(bound.points),
        "stages": list(sequence.stages),
        "length": sequence.length if asked.mesh is None else f"the unit of {asked.mesh.name}",
    }
    if bound is not None:
        document["mesh"] = bound.report()
        _warn(bound)

    def show(console: Any) -> None:
        console.print(f"{_size(len(data), len(sequence))}, lengths in {document['length']}", markup=False)
        for name, value in document.get("mesh", {}).items():
            console.print(f"{name} {value:.3g}", markup=False)
        console.print(f"written to {out}", markup=False)

    emit(document, asked.as_json, show)


def _format(name: str | None, out: Path | None, result: str) -> tuple[Export | None, Path]:
    """Return the format asked for, None for OBJ of one stage, and the file, here and called as the result if unnamed.

    Raises:
        InvalidOption: there is no such format, or no place for the file.

    """
    from ..sequences import EXPORTS

    known = [*EXPORTS, "obj"]
    # every .glb is an animation, of one stage or more
    name = "animation" if name == "glb" else name
    if out is None:
        if name not in known:
            raise InvalidOption("nothing says what to write.", "Name a file (--out x.glb) or a format (--format pc2).")
        out = Path(Path(result).stem + (EXPORTS[name].suffix if name in EXPORTS else ".obj"))
    kind = out.suffix.lower()
    fits = [e.name for e in EXPORTS.values() if out.name.lower().endswith(e.suffix)] or ["obj"] * (kind == ".obj")
    if name is None:
        name = fits[0] if fits else "ply-zip" if kind == ".zip" else out.suffix
    if name not in known:
        suffixes = ", ".join([*(e.suffix for e in EXPORTS.values()), ".obj"])
        raise InvalidOption(f"cannot write {name!r}.", f"Formats: {', '.join(known)}; suffixes: {suffixes}.")
    if fits and name not in fits:
        raise InvalidOption(f"--out {out} is named as {fits[0]}, and --format says {name}.", "Leave one of them out.")
    if out.is_dir() or not out.absolute().parent.is_dir():
        raise InvalidOption(f"--out {out} is no place for a file.", "Name a file in a directory that exists.")
    return EXPORTS.get(name), out


def _read(result: str, store: Path | None) -> xr.Dataset:
    from store import shards
    from store.store import Store
    from sweeps.results import resolve

    path = Path(result)
    if path.suffix.lower() == ".h5":
        if not path.is_file():
            raise InvalidOption(f"there is no file {result}.", "`wizen solve ... --out run.h5` writes one.")
        return shards.read(path)
    if path.suffix and path.is_file():
        raise InvalidOption(f"{result} holds no result: result files are .h5.", "Name one, or a key and --store.")
    if store is None:
        raise InvalidOption(f"{result[:80]!r} is no file.", "Name a result file (.h5), or a key's --store.")
    opened = Store.open(store)
    return opened.get(resolve(opened, result))


def _shown(run: xr.Dataset) -> xr.Dataset:
    """Return a result that has a surface: where it was stored without one, it is solved again."""
    from solver.contract import Context
    from sweeps import tabled
    from sweeps.commands.terminal import progress
    from sweeps.surfaced import has_surface, surfaced

    if has_surface(run):
        return run
    note("the result was stored without its surface: it is solved again, which takes as long as it took.")
    with progress.one_run("solve") as observe, progress.stopping() as stop:
        return surfaced(run, Context(observe, stop.is_set, shapes=tabled.shape)) or run


def _counted(stages: int) -> str:
    return f"{stages} stage{'' if stages == 1 else 's'}"


def _size(count: int, stages: int) -> str:
    return f"{count / 1e6:.3g} MB, {_counted(stages)}"


def _warn_of_threads(run: xr.Dataset, threads: int | None) -> None:
    """Say where threads are asked for and nothing that grows them is in the result."""
    from sweeps.pictures import colours

    if threads and colours.looks(run).fur is None:
        note(f"no mould grows on results of {run.attrs.get('solver', 'this solver')}: --threads adds nothing.")


def _written(sequence: Sequence, chosen: Export | None, options: Options) -> bytes:
    from ..sequences import STILLS, write

    return STILLS["obj"](sequence, options) if chosen is None else write(sequence, chosen, options)


def _bound(mesh: Path, run: xr.Dataset, options: Options, binding: str | None, fit: str) -> Bound:
    from ..sequences import of_run
    from ..sequences.imported import bind, load

    if binding not in (None, "nearest", "direction"):
        raise InvalidOption(f"--binding {binding}: there is no such binding.", "Take nearest or direction.")
    if fit not in ("box", "none"):
        raise InvalidOption(f"--fit {fit}: there is no such fit.", "Take box or none.")
    if options.scale != 1:
        raise InvalidOption("--scale has no meaning with --mesh.", "The cache is in the units of the mesh.")
    points, faces = load(mesh)
    return bind(points, faces, of_run(run), binding, fit)  # type: ignore[arg-type]


def _moved(bound: Bound, sequence: Sequence, chosen: Export | None, options: Options) -> bytes:
    from ..sequences.caches import mdd_of, pc2_of

    encoders = {"pc2": pc2_of, "mdd": mdd_of}
    if chosen is None or chosen.name not in encoders:
        raise InvalidOption("--mesh goes with a vertex cache.", "Write --out FILE.pc2 or FILE.mdd.")
    return encoders[chosen.name]([bound.moved(surface) for surface in sequence], options)


def _warn(bound: Bound) -> None:
    """Say where the mesh is too far away, or too coarse, to show what the result shows."""
    found = bound.report()
    if found["gap_max"] > 0.05:
        note(f"the mesh lies up to {found['gap_max']:.0%} of the result's size off its surface: shapes differ.")
    if found["coarseness"] > 2:
        note(f"the mesh's edges are {found['coarseness']:.1f} times as long as the result's: finer wrinkles are lost.")
