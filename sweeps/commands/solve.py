"""`wizen solve`: one run, here and now, with all that a need can say."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InvalidOption, SweepError
from .terminal.console import emit, note
from .terminal.grouped import grouped
from .terminal.options import (
    As_json,
    Hours,
    Most_seconds,
    Out,
    Params,
    Preset,
    Quality,
    Seed,
    Set,
    Stages,
    Under,
    assignments,
    parameters,
    shown,
    stages_asked,
)
from .terminal.regions import Region, check_file, part

if TYPE_CHECKING:
    import xarray as xr

    from solver.contract import Need, Solver
    from solver.contract import Params as Parameters

    from ..formats import Made

__all__ = ["add_to"]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(solve)


@dataclass(frozen=True)
class _Asked:
    """What `wizen solve` is told."""

    solver: Annotated[str, typer.Argument(help="Name of a solver (`wizen presets`).")]
    preset: Preset = None
    params_file: Params = None
    set_: Set = None
    stages: Stages = None
    hours: Hours = None
    under: Under = None
    quality: Quality = None
    tolerance: Annotated[
        float | None, typer.Option("--tolerance", metavar="E", help="Relative error in place of a quality, e.g. 0.2.")
    ] = None
    fields: Annotated[
        str | None, typer.Option("--fields", metavar="NAME,...", help="What to keep; nothing else is computed.")
    ] = None
    resolution: Annotated[
        int | None, typer.Option("--resolution", metavar="N", help="Colatitudes of surface fields; azimuths are 2 N.")
    ] = None
    region: Region = None
    dtype: Annotated[str | None, typer.Option("--dtype", help="float32 or float64, of surface fields.")] = None
    seed: Seed = None
    max_seconds: Most_seconds = None
    out: Out = None
    cut: Annotated[
        str | None,
        typer.Option("--cut", metavar="PLANE", help=".png: cut along an azimuth (degree), equator, or a plane."),
    ] = None
    as_json: As_json = False


@grouped(_Asked)
def solve(asked: _Asked) -> None:
    """Run a solver once, here and now, without a store.

    --out takes .h5 (netCDF-4: the whole run, as a store keeps it), .npz, .png or .json, shapes as .obj or .glb, all
    stages as a clip: .glb, .usda, .usdc, .usdz, and numbers by stage as a table, .csv, or drawn, .svg.

    [bold]Examples[/bold]

    wizen solve dehydration --preset sphere --set te=0.04 --set gamma=30 --stages 0.1,0.2 --out run.h5

    wizen solve dehydration --preset plum1 --quality preview --stages 0.3 --out plum.png --json

    wizen solve decay --preset orange --stages 0,4,8 --out inside.png --cut 35

    wizen solve decay --preset orange --stages 0,4,8 --out open.png --cut 0,0,0,0,0,1

    wizen solve dehydration --fields mesh_position --stages 0.2 --out as-solved.glb

    wizen solve dehydration --stages 0.2 --region 45:90,350:20 --out part.npz

    wizen solve dehydration --preset raisin --quality preview --hours 24,48,96 --out sunny.glb

    wizen solve growth --params examples/growth/c-pumpkin.toml --out pumpkin.png

    wizen solve wood --params examples/wood/knee.toml --quality preview --out knee.csv
    """
    from solver.contract import SolverError, budget

    from .terminal.words import show_run

    if asked.cut is not None:
        _check_cut(asked.cut, asked.out)
    chosen, params, need = _parsed(asked)
    if asked.max_seconds is not None:
        budget.within(chosen, (params,), need, asked.max_seconds)
    begin = time.perf_counter()
    try:
        result = _run(chosen, params, need)
    except SolverError as error:
        if asked.out is not None and error.partial is not None:
            _keep_settled(asked, chosen, params, need, error.partial)
        raise
    document = _told(asked, chosen, params, need, result) | {"seconds": round(time.perf_counter() - begin, 3)}
    if asked.out is not None:
        _save(asked.out, _title(asked, chosen), chosen, params, result, document, asked.cut)
    emit(document, asked.as_json, lambda console: show_run(console, document, chosen.stages.symbol))


def _told(asked: _Asked, solver: Solver, params: Parameters, need: Need, result: xr.Dataset) -> dict[str, Any]:
    """Return what is told of a run, but for its seconds."""
    from store import shards

    from ..planning.plan import job
    from .terminal.words import per_stage

    spec = job(solver, params, need)
    return {
        **{name: getattr(spec, name) for name in ("key", "solver", "version", "params", "need")},
        "digest": shards.digest(result),
        # what a solver has to say of how it ran
        "note": result.attrs.get("note"),
        "path": asked.out and str(asked.out),
        "stages": [float(stage) for stage in result["stage"]],
        "descriptors": per_stage(result),
    }


def _keep_settled(asked: _Asked, solver: Solver, params: Parameters, need: Need, partial: xr.Dataset) -> None:
    """Write the stages that a run settled before it failed, as a run that was asked for these alone."""
    from solver.contract import SolverError, finish
    from store.errors import StoreError

    assert asked.out is not None
    stages = tuple(float(stage) for stage in partial["stage"])
    if not stages:
        return
    less = need.model_copy(update={"stages": stages})
    # why the run failed is what counts, whatever else a file may want
    with suppress(SolverError, StoreError, SweepError, OSError):
        result = finish(partial.copy(), solver, params, less)
        _save(
            asked.out, _title(asked, solver), solver, params, result, _told(asked, solver, params, less, result), None
        )
        symbol = solver.stages.symbol
        note(f"{symbol} = {', '.join(f'{stage:g}' for stage in stages)} settled before, and {asked.out} holds them")


def _parsed(asked: _Asked) -> tuple[Solver, Parameters, Need]:
    """Return the solver, the run's parameters and its need, settled."""
    from solver import registry
    from solver.contract import Need

    chosen = registry.get(asked.solver)
    given = assignments(asked.set_)
    if asked.seed is not None:
        if "seed" in given:
            raise InvalidOption("--seed and --set seed say the same.", "Keep one of them.")
        given["seed"] = asked.seed
    params = chosen.parse(chosen.params.over(parameters(asked.params_file), given), asked.preset)
    said: dict[str, Any] = {name: getattr(asked, name) for name in ("quality", "tolerance", "resolution", "dtype")}
    where = part(asked.region)
    said["region"] = None if where is None else where.need
    wanted = stages_asked(chosen, asked.stages, asked.hours, asked.under, asked.preset)
    names = asked.fields.split(",") if asked.fields else ()
    kept = {"stages": wanted, "fields": [name.strip() for name in names]}
    need = Need.parse(kept | {name: value for name, value in said.items() if value is not None})
    return chosen, params, _for_file(asked.out, chosen, chosen.settle(need, asked.preset, (params,)))


def _run(solver: Solver, params: Parameters, need: Need) -> xr.Dataset:
    """Return the result; progress is shown, and an interrupt ends it well."""
    from solver.contract import Context

    from .. import tabled
    from .terminal import progress

    said = solver.remarks(params, need) if solver.remarks is not None else ""
    if said:
        note(f"note: {said}")
    with progress.one_run(solver.name) as observe, progress.stopping() as stop:
        return solver.solve(params, need, Context(observe, stop.is_set, shapes=tabled.shape))


def _for_file(out: Path | None, solver: Solver, need: Need) -> Need:
    """Return the need, settled, with the fields that a file wants; refuse what could not be written."""
    if out is None:
        return need
    from .. import outputs

    outputs.check_suffix(out, True, len(need.stages))
    wanted = outputs.fields_for(out, True, solver, need.fields)
    if need.region is not None and "position" in wanted:
        check_file(out, True)
    return solver.settle(need.model_copy(update={"fields": (*need.fields, *wanted)}))


def _title(asked: _Asked, solver: Solver) -> str:
    """Return what a picture is called: preset or file of parameters, and what was set besides; stages have labels."""
    of = asked.preset or (asked.params_file.stem if asked.params_file else "")
    said = shown([*(asked.set_ or ()), *([] if asked.seed is None else [f"seed={asked.seed}"])])
    if said:
        return f"{of or solver.name}: {said}"
    return f"{solver.title}: {of}" if of else solver.title


def _save(
    out: Path,
    title: str,
    solver: Solver,
    params: Parameters,
    result: xr.Dataset,
    document: dict[str, Any],
    cut: str | None,
) -> None:
    """Write a run and the shapes in it."""
    from .. import outputs
    from ..formats import Made

    axes, plain = {name: params.axis(name) for name in params.axes}, params.model_dump(mode="json")
    is_whole = document["need"].get("region") is None
    count = result.sizes["stage"] if "position" in result and is_whole else 0
    made = Made(
        [outputs.of_result(result, axes, i) for i in range(count)],
        document,
        title,
        solver.name,
        stage_symbol=solver.stages.symbol,
        units={**solver.axis_units(), solver.stages.symbol: solver.stages.units},
        run=result,
        key=document["key"],
        cut=cut,
        shade=solver.shade(plain),
        reach=solver.stages.reach,
        metres=solver.metres(plain),
    )
    try:
        outputs.save(out, made)
    except Exception:
        _keep(out, made)
        raise


def _keep(out: Path, made: Made) -> None:
    """Write a whole run beside a file that it could not be written as: what took minutes is not lost."""
    from store.errors import StorageFull

    from .. import outputs

    kept = out.with_name(f"{out.stem}-{made.key[:12]}.h5")
    if out.suffix.lower() == kept.suffix:
        return
    # where a disk is full or a folder is closed, why the file itself failed is what counts
    with suppress(OSError, StorageFull):
        if not kept.exists():
            outputs.save(kept, made)
        note(f"the run is kept in {kept}: `wizen export {kept}` writes it otherwise")


def _check_cut(cut: str, out: Path | None) -> None:
    """Refuse, before any work, a cut that nobody could draw."""
    from .. import opened
    from ..pictures import section

    if "," in cut:
        opened.parsed(cut)
    else:
        section.plane(cut)
    if out is None or out.suffix.lower() != ".png":
        raise InvalidOption("--cut draws a picture.", "Name it: --out FILE.png.")
