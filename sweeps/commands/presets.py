"""What may be asked of a solver: its presets, and what each of its parameters means."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .terminal.console import emit, grid
from .terminal.options import As_json

if TYPE_CHECKING:
    from rich.console import Console

    from solver.contract import Solver

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command of this module to the root command."""
    app.command()(presets)


def presets(
    name: Annotated[str | None, typer.Argument(metavar="[SOLVER]", help="Only this one, with its parameters.")] = None,
    preset: Annotated[str | None, typer.Argument(metavar="[PRESET]", help="Every parameter of this preset.")] = None,
    as_json: As_json = False,
) -> None:
    """List the solvers and their named presets; of one solver what its parameters mean, of a preset their values.

    [bold]Examples[/bold]

    wizen presets

    wizen presets dehydration

    wizen presets decay orange

    wizen presets --json | jq '.dehydration.presets.plum1'
    """
    from solver import registry

    solvers = {each: registry.get(each) for each in (registry.names() if name is None else (name,))}
    if name is not None and preset is not None:
        solver = solvers[name]
        values = solver.parse({}, preset).model_dump(mode="json")
        document: dict[str, Any] = {"solver": name, "preset": preset, "parameters": values}
        emit(document, as_json, lambda console: _show_preset(console, solver, preset, values))
        return

    def show(console: Console) -> None:
        for each, solver in solvers.items():
            console.print(f"\n[bold]{each}[/bold]: {solver.title}", markup=True)
            console.print(", ".join(solver.presets), markup=False)
            if name is not None:
                _show_parameters(console, solver)
        one = name or next(iter(solvers))
        shown = next(iter(solvers[one].presets))
        more = "says what its parameters mean" if name is None else "says what it sets"
        about = one if name is None else f"{one} {shown}"
        console.print(
            f"\n`wizen presets {about}` {more}; `wizen solve {one} --preset {shown} --out {shown}.png` runs it.",
            markup=False,
        )

    emit({each: _described(solver) for each, solver in solvers.items()}, as_json, show)


def _described(solver: Solver) -> dict[str, Any]:
    return {
        "title": solver.title,
        "version": solver.version,
        "axes": {axis: field for axis, (field, _) in solver.params.axes.items()},
        "fields": list(solver.fields),
        "presets": {preset: dict(values) for preset, values in solver.presets.items()},
    }


def _show_parameters(console: Console, solver: Solver) -> None:
    """Say what each parameter means, its unit, what it is if nobody says, and the short names of its entries."""
    from .terminal.words import short

    plain = solver.params.model_validate({}).model_dump(mode="json")
    rows = []
    for field, info in solver.params.model_fields.items():
        axes = [axis for axis, (own, _) in solver.params.axes.items() if own == field]
        also = f" (or one by one: {', '.join(axes)})" if axes else ""
        text = f"{info.description or ''}{also}"
        rows.append((field, _units(solver, field), short(plain[field]) if field in plain else "", text))
    grid(console, ("--set", "unit", "default", "means"), rows)


def _show_preset(console: Console, solver: Solver, preset: str, values: Mapping[str, Any]) -> None:
    """Say what each parameter of a preset is, groups of them entry by entry, and which the preset sets."""
    from .terminal.words import short

    said = solver.presets[preset]
    rows = []
    for field, value in values.items():
        mark = "*" if field in said else ""
        parts = [(f"{field}.{k}", v) for k, v in value.items()] if isinstance(value, dict) else [(field, value)]
        rows += [(word, short(one), _units(solver, field), mark) for word, one in parts]
    grid(console, ("parameter", "value", "unit", "by the preset"), rows, f"{solver.name}: {preset}")


def _units(solver: Solver, field: str) -> str:
    extra = solver.params.model_fields[field].json_schema_extra
    units = str(extra.get("units", "")) if isinstance(extra, dict) else ""
    return "" if units == "1" else units
