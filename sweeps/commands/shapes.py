"""The commands that show what a table holds between its samples: map and query."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InvalidOption
from .terminal.console import emit, grid
from .terminal.grouped import grouped
from .terminal.options import (
    As_json,
    Hours,
    Out,
    Preset,
    Set,
    Stages,
    StoreToRead,
    Under,
    assignments,
    numbers,
    stages_asked,
)
from .terminal.regions import Region, check_file, part
from .terminal.tables import asked_table, open_store, run_command, solver_of

if TYPE_CHECKING:
    from solver.contract import Context, Solver
    from store.lookup import ShapeTable
    from store.shape import Shape

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the commands of this module to the root command."""
    app.command("map")(draw_map)
    app.command()(query)


@dataclass(frozen=True)
class _Drawn:
    """What `wizen map` is told."""

    out: Annotated[Path, typer.Option("--out", metavar="FILE.png", help="The picture.")]
    store: StoreToRead = None
    name: Annotated[
        str | None, typer.Option("--name", help="The table; without, the one that holds --preset and --set.")
    ] = None
    preset: Preset = None
    x: Annotated[str | None, typer.Option("--x", metavar="AXIS", help="From left to right.")] = None
    y: Annotated[str | None, typer.Option("--y", metavar="AXIS", help="From bottom to top.")] = None
    stage: Annotated[float | None, typer.Option("--stage", help="One stage; the last one if not given.")] = None
    stages: Stages = None
    set_: Set = None
    pixels: Annotated[int, typer.Option("--pixels", min=32, max=1024, help="Side of one fruit.")] = 260
    as_json: As_json = False


@grouped(_Drawn)
def draw_map(asked: _Drawn) -> None:
    """Draw a table as a contact sheet: two axes at one stage, or with --stages one row per sample.

    [bold]Examples[/bold]

    wizen map --store demo --out map.png --x gamma --y te --stage 0.3

    wizen map --store demo --out stages.png --stages 0.1,0.2,0.3
    """
    from solver import registry
    from store import seal
    from store.blending.asking import settle
    from store.families import stored

    from .. import families, outputs
    from ..pictures.maps import Map

    out = asked.out
    if out.suffix.lower() != ".png":
        raise InvalidOption(f"--out {out}: a map is a picture.", "Name it .png.")
    if asked.stage is not None and asked.stages is not None:
        raise InvalidOption("--stage and --stages exclude each other.", "Keep one of them.")
    outputs.check_suffix(out, False, 1)
    said = assignments(asked.set_)
    table, values = asked_table(asked.store, asked.name, None, said, asked.stage, asked.preset)
    if asked.preset is not None:
        settle(table.info, values)  # a table that is named need not hold the preset
    name, given = table.info.name, {axis: value for axis, value in values.items() if axis in said}
    solver, store = registry.get(table.info.solver), open_store(asked.store)
    shade = families.shade(solver, table.info, stored.families(store, solver))
    drawing = Map(store, table, solver.axis_units(), given, asked.pixels, shade)
    if asked.stages is not None:
        picture = drawing.by_stages(numbers(asked.stages))
    else:
        picture = drawing.by_axes(asked.x, asked.y, table.stages[-1] if asked.stage is None else asked.stage)
    seal.publish(out, picture)
    document = {"path": str(out), "table": name, "digest": table.digest, "shapes": drawing.count}
    emit(document, asked.as_json, lambda console: console.print(f"{drawing.count} shapes drawn to {out}", markup=False))


@dataclass(frozen=True)
class _Asked:
    """What `wizen query` is told."""

    store: StoreToRead = None
    set_: Set = None
    stages: Stages = None
    hours: Hours = None
    under: Under = None
    preset: Preset = None
    name: Annotated[
        str | None, typer.Option("--name", help="The table; without, the one of --solver that holds this.")
    ] = None
    solver: Annotated[str | None, typer.Option("--solver", help="Whose shapes, if several have tables.")] = None
    resolution: Annotated[int | None, typer.Option("--resolution", help="Colatitude samples (4 to 1024).")] = None
    region: Region = None
    method: Annotated[str | None, typer.Option("--method", help="How to look up, as `table score` names it.")] = None
    max_error: Annotated[
        str | None,
        typer.Option("--max-error", metavar="X|M:X,...", help="Refuse worse: 0.05 (roughness), rgh:0.05,dB:1.5."),
    ] = None
    relax: Annotated[
        bool, typer.Option("--relax", help="Let the solver relax what was looked up: an equilibrium, in seconds.")
    ] = False
    out: Out = None
    as_json: As_json = False


@grouped(_Asked)
def query(asked: _Asked) -> None:
    """Ask the tables for a shape between their samples, and write it.

    --out takes one stage as .glb, .obj or .wzp (points alone), all of them as .npz, .png or .json (numbers about them).

    Presets fill what is not set. The table is the one that holds these parameters; where none does, the nearest is
    named, with what differs.

    [bold]Examples[/bold]

    wizen query --preset sphere --set te=0.034 --stages 0.2 --out fruit.glb

    wizen query --set te=0.034 --set gamma=22 --stages 0.2 --out fruit.glb

    wizen query --store demo --set te=0.034 --set gamma=22 --stages 0.2 --out shape.obj

    wizen query --set te=0.034 --set gamma=22 --stages 0.2 --method idw --out paper.glb

    wizen query --set te=0.034 --set gamma=22 --hours 48 --under kinetics=grape --out sunny.glb

    wizen query --preset plum1 --stages 0.2 --region 45:90,350:20 --out part.npz

    wizen query --set te=0.034 --set gamma=22 --stages 0.2 --max-error rgh:0.1,dB:3

    wizen query --set te=0.034 --set gamma=22 --stages 0.2 --relax --out balanced.glb

    wizen query --store demo --set te=0.034 --set gamma=22 --stages 0.1,0.2,0.3 --out row.png --json
    """
    from solver import registry
    from store.families import stored

    from .. import families, outputs
    from ..formats import Made

    table, shapes, notes = _found(asked)
    name, known = table.info.name, registry.get(table.info.solver)
    document = {
        "table": name,
        "digest": table.digest,
        "method": shapes[0].method,
        "parameters": _parameters(table, shapes[0].parameters),
        "path": None if asked.out is None else str(asked.out),
        "stages": [{**_document(shape), **note} for shape, note in zip(shapes, notes, strict=True)],
    }
    where, rows = part(asked.region), asked.resolution or table.resolution
    if where is not None:
        document["region"] = where.said(rows)
    if asked.out is not None:
        place = ", ".join(f"{axis} = {value:g}" for axis, value in shapes[0].parameters.items())
        title = ": ".join(word for word in (asked.preset or name, place) if word)
        fixed, done, units = families.said(known, table.info)
        made = Made(shapes, document, title, known.name, name, fixed, known.stages.symbol, units, made=done)
        if where is not None:
            part_of = {"resolution": rows, "waves": min(table.resolution, rows), "region": document["region"]}
            made = replace(made, detail=part_of)
        shade = families.shade(known, table.info, stored.families(open_store(asked.store), known))
        metres = known.metres(table.at_parameters(shapes[0].parameters))
        outputs.save(asked.out, replace(made, shade=shade, reach=table.reach, metres=metres))
    emit(document, asked.as_json, lambda console: _show(console, name, shapes, notes, known.stages.symbol, asked.out))


def _parameters(table: ShapeTable, values: Mapping[str, float]) -> dict[str, Any]:
    """Return what a shape is of by names that --set takes: an entry that has none of its own is in its whole field."""
    known = {**table.fixed, **values}
    named = {name: value for name, value in known.items() if name.isidentifier()}
    whole = table.at_parameters(values)
    return named | {field: whole[field] for field in sorted({n.partition("[")[0] for n in known.keys() - named.keys()})}


def _found(asked: _Asked) -> tuple[ShapeTable, list[Shape], list[Mapping[str, Any]]]:
    """Return the table, the shapes that were asked for, and what relaxing them has to say of each."""
    from solver import registry
    from solver.contract import Context
    from store.blending import methods

    from .. import outputs

    said, out = assignments(asked.set_), asked.out
    solver = solver_of(open_store(asked.store), asked.name, asked.solver)
    wanted = stages_asked(solver, asked.stages, asked.hours, asked.under, asked.preset)
    last = max(wanted, key=abs, default=None)
    table, values = asked_table(asked.store, asked.name, asked.solver, said, last, asked.preset)
    if not wanted:
        low, high = table.reach
        raise InvalidOption("--stages is missing.", f"The table has stages {low:g} to {high:g}.")
    where = part(asked.region)
    if where is not None and asked.relax:
        raise InvalidOption("--relax is of whole shapes, and --region leaves a part.", "Keep one of them.")
    if asked.relax and asked.max_error is not None:
        raise InvalidOption("--max-error: nobody knows the error of what is relaxed.", "Leave it out.")
    if out is not None:
        outputs.check_suffix(out, False, len(wanted))
    fields = outputs.fields_for(out, False)
    if out is not None and where is not None and "position" in fields:
        check_file(out, False)
    if asked.relax:
        fields = tuple(sorted({*fields, "position"}))
    how, limits = asked.method or methods.DEFAULT, _limits(asked.max_error)
    told: dict[str, Any] = {"resolution": asked.resolution, "fields": fields, "method": how, "max_error": limits}
    told |= {} if where is None else {"window": where.window}
    shapes = [table.at(values, stage, **told) for stage in wanted]
    notes: list[Mapping[str, Any]] = [{} for _ in shapes]
    if asked.relax:
        known = registry.get(table.info.solver)
        context = Context(library=open_store(asked.store).find)
        shapes, notes = map(list, zip(*(_relaxed(known, table, shape, context) for shape in shapes), strict=True))
    return table, shapes, notes


def _relaxed(solver: Solver, table: ShapeTable, shape: Shape, context: Context) -> tuple[Shape, Mapping[str, Any]]:
    """Return a shape relaxed, and what is said of it.

    Raises:
        SolverError: as `relaxing.relaxed`; where the shape falls apart, with the command that runs it from the start
            as the table's runs are done, but for what only their plan can have them start from.

    """
    from solver.contract import Unstable
    from store.families import stored

    from ..relaxing import relaxed

    try:
        return relaxed(solver, table, shape, context=context)
    except Unstable as error:
        usual, given = solver.parse({}), solver.parse(table.at_parameters(shape.parameters))
        said = {axis: given.axis(axis) for axis in given.axes if given.axis(axis) != usual.axis(axis)}
        done = stored.made(table.info, solver)
        said |= {name: value for name, value in done.items() if not isinstance(value, Mapping)}
        told = [error.advice, *(_beyond(name, table) for name, value in done.items() if isinstance(value, Mapping))]
        advice = " ".join([*told, run_command(solver.name, None, said, shape.stage)])
        raise Unstable(error.message, advice=advice.strip(), residual=error.residual) from None


def _beyond(name: str, table: ShapeTable) -> str:
    """Return what is said of something that the table's runs have and one run alone, without a store, cannot."""
    return f"Without the {name} of the table's runs, which `wizen table plan {table.info.name}` has:"


def _show(
    console: Any, name: str, shapes: list[Shape], notes: list[Mapping[str, Any]], symbol: str, out: Path | None
) -> None:
    from solver.rounding import from_zero
    from store.surfaces import measures

    last = shapes[-1]
    whose = ", of the runs" if last.tier == "table" else ""
    rows = [
        [key + whose, last.units.get(key, "1")]
        + [f"{shape.descriptors.get(key, float('nan')):.4g}" for shape in shapes]
        for key in last.descriptors
    ]
    errors = [shape.expected_error for shape in shapes if shape.expected_error is not None]
    if len(errors) == len(shapes):
        rows += [
            [f"expected error of {measures.OF[key]} ({key})", measures.UNITS[key]]
            + [from_zero(said[key]) for said in errors]
            for key in errors[0]
        ]
    if any(notes):
        rows += [["in balance", "", *("yes" if shape.converged else "no" for shape in shapes)]]
        for key, said in (("residual", "residual"), ("moved", "moved, over the roughness")):
            rows += [[said, "1", *(f"{told[key]:.2g}" if told else "" for told in notes)]]
    rows += [["a stored run, as it is", "", *("yes" if shape.exact else "no" for shape in shapes)]]
    if any(shape.held is not None and shape.held < _ALL_HELD for shape in shapes):
        told = ("unknown" if shape.held is None else f"{100 * shape.held:.0f}" for shape in shapes)
        rows += [["wrinkles' height that this lattice holds, at least", "%", *told]]
    if any(shape.crossings is not None for shape in shapes):
        told = ("unknown" if shape.crossings is None else str(shape.crossings) for shape in shapes)
        rows += [["crossing pairs as handed over", "1", *told]]
    if any(shape.volume is not None for shape in shapes):
        told = ("unknown" if shape.volume is None else f"{shape.volume:.4g}" for shape in shapes)
        rows += [["volume as handed over", "r1^3", *told]]
    place = ", ".join(f"{axis} = {value:g}" for axis, value in last.parameters.items())
    head = ["", "unit", *(f"{symbol} = {shape.stage:g}" for shape in shapes)]
    grid(console, head, rows, title=f"{name}: {place}" if place else name)
    if out is not None:
        console.print(f"written to {out}", markup=False)


#: Share of the wrinkles' height above which a lattice holds it.
_ALL_HELD = 0.995


def _limits(text: str | None) -> dict[str, float] | None:
    """Return the limits by measure that `0.05` (of the roughness) or `rgh:0.05,dB:1.5` set.

    Raises:
        InvalidOption: the text sets none, or one of a measure twice.

    """
    if text is None:
        return None
    pairs = [part.rpartition(":") for part in text.split(",")]
    try:
        limits = {name or "rgh": float(value) for name, _, value in pairs}
    except ValueError:
        raise InvalidOption(f"--max-error {text}: limits no error.", "Write 0.05, or rgh:0.05,dB:1.5.") from None
    if len(limits) < len(pairs):
        raise InvalidOption(f"--max-error {text}: limits a measure twice.", "Limit each measure once.")
    return limits


def _document(shape: Any) -> dict[str, Any]:
    return {
        "stage": shape.stage,
        **shape.trust(),
        "volume": shape.volume,
        "weights": dict(shape.weights),
        "descriptors": {
            name: {"value": value, "units": shape.units.get(name, "")} for name, value in shape.descriptors.items()
        },
    }
