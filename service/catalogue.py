"""What there is: tables, solvers with their parameter schemas, and whether all is well."""

from __future__ import annotations

import hashlib
from typing import Any

from fastapi import APIRouter, Path, Request
from starlette.responses import JSONResponse, Response

from solver import __version__, quantities, registry
from solver.contract import Solver
from store.blending import methods
from store.errors import CorruptTable, StoreError
from store.tables import TableInfo

from . import page, portraits, problems, vocabulary
from .errors import UnknownPreset
from .formats import FORMATS
from .sequences import EXPORTS
from .settings import Settings
from .shapes.live import LiveTables
from .views.addresses import link
from .views.catalogue import Health, Index, SolverList, SolverPage, TableList, TablePage
from .views.tags import matches

__all__ = ["open_router", "router"]

#: Pages that need no token ever, and the others.
open_router, router = APIRouter(tags=["catalogue"]), APIRouter(tags=["catalogue"])

Json = dict[str, Any]

_PNG = problems.files(["image/png"])


@open_router.get(
    "/",
    summary="Where to go from here",
    response_class=Response,
    responses={200: {"model": Index, "content": {"text/html": {"schema": {"type": "string"}}}}},
)
def index(request: Request) -> Response:
    """List the service's pages; a browser is shown the viewer."""
    if page.wanted(request.headers.get("accept")):
        return page.answer(request)
    links = {
        "maps": "/v1/maps",
        "tables": "/v1/tables",
        "solvers": "/v1/solvers",
        "shapes": "/v1/shapes/{solver}",
        "batches": "/v1/shapes:batch",
        "scenes": "/v1/scenes",
        "match": "/v1/match",
        "jobs": "/v1/jobs",
        "results": "/v1/results",
        "meshes": "/v1/meshes",
        "health": "/healthz",
        "documentation": "/docs",
        "schema": "/openapi.json",
    }
    formats = {f.name: {"media_type": f.media_type, "title": f.title} for f in FORMATS.values()}
    exports = {e.name: {"media_type": e.media_type, "title": e.title} for e in EXPORTS.values()}
    body = {"name": "wizen", "version": __version__, "links": links, "formats": formats, "result_formats": exports}
    body["links"] = {name: link(path) for name, path in links.items()}
    return JSONResponse(body, headers={"Vary": "Accept"})


@open_router.get(
    "/healthz",
    summary="Whether shapes can be served",
    response_model=Health,
    response_model_exclude_unset=True,
    responses=problems.responses(503),
)
def health(request: Request) -> Json:
    """Open every table; 200 only if the store and all its tables can be read.

    A table whose newest generation is damaged is still served from the one before, and says so under `complaint`.
    """
    tables: LiveTables = request.app.state.tables
    found = {}
    for name in tables.names():
        table = tables.get(name)
        complaint = tables.complaint(name)
        found[name] = {"digest": table.digest, "samples": table.size, **({"complaint": complaint} if complaint else {})}
    return {"status": "ok", "version": __version__, "tables": found}


@router.get(
    "/v1/tables",
    summary="All tables",
    response_model=TableList,
    response_model_exclude_unset=True,
    responses=problems.responses(503),
)
def tables(request: Request) -> Json:
    """List the tables that shapes can be asked of; a damaged one has a `complaint` in place of its axes."""
    live: LiveTables = request.app.state.tables
    found = []
    for name in live.names():
        try:
            found.append(_table(request, live.info(name)))
        except CorruptTable as error:
            found.append({"name": name, "complaint": str(error)})
    return {"tables": found}


@router.get(
    "/v1/tables/{name}",
    summary="One table",
    response_model=TablePage,
    response_model_exclude_unset=True,
    responses=problems.responses(404, 503),
)
def table(request: Request, name: str = Path(description="Name of a table; GET /v1/tables lists them")) -> Json:
    """Describe a table: its axes with ranges and units, its stages and its generation."""
    live: LiveTables = request.app.state.tables
    return _table(request, live.info(name))


@router.get("/v1/solvers", summary="All solvers", response_model=SolverList)
def solvers() -> Json:
    """List the solvers."""
    found = [registry.get(name) for name in registry.names()]
    return {
        "solvers": [
            {"name": s.name, "title": s.title, "advance": s.looks.advance, "href": link(f"/v1/solvers/{s.name}")}
            for s in found
        ]
    }


@router.get(
    "/v1/solvers/{name}",
    summary="One solver",
    response_model=SolverPage,
    response_model_exclude_unset=True,
    responses=problems.responses(404),
)
def solver(request: Request, name: str = Path(description="Name of a solver; GET /v1/solvers lists them")) -> Json:
    """Describe a solver: parameter schema, query axes and stage axis with units, fields, presets, looks, qualities."""
    known = vocabulary.solver_named(name)
    links = {"jobs": link("/v1/jobs")}
    try:
        is_tabled = known.name in request.app.state.tables.solvers()
    except StoreError:
        is_tabled = False  # a solver can be told of without a store
    return {**_solver(known), "links": {**({"shapes": link(f"/v1/shapes/{known.name}")} if is_tabled else {}), **links}}


@router.get(
    "/v1/solvers/{name}/presets/{preset}/portrait.png",
    summary="A picture of a preset",
    response_class=Response,
    responses={200: {"content": _PNG}, 304: {"description": "It has not changed"}, **problems.responses(404)},
)
def portrait(
    request: Request,
    name: str = Path(description="Name of a solver; GET /v1/solvers lists them"),
    preset: str = Path(description="Name of a preset; the solver's page says which have a picture"),
) -> Response:
    """Return the picture that comes with wizen of what a preset makes; the solver's page says of which stage it is."""
    known = vocabulary.solver_named(name)
    data = portraits.png(known.name, preset)
    if data is None:
        raise UnknownPreset(
            f"there is no picture of {known.name}'s {preset[:40]!r}.",
            advice=f"Those of {', '.join(portraits.said(known.name)) or 'no preset'} are there.",
        )
    tag = f'"{hashlib.sha256(data).hexdigest()[:32]}"'
    settings: Settings = request.app.state.settings
    headers = {"ETag": tag, "Cache-Control": settings.kept(86400)}
    if matches(request.headers.get("if-none-match", ""), tag):
        return Response(status_code=304, headers=headers)
    return Response(data, headers=headers, media_type="image/png")


def _solver(solver: Solver) -> Json:
    return {
        "name": solver.name,
        "version": solver.version,
        "title": solver.title,
        "params": solver.params.model_json_schema(),
        "axes": {name: _bounds(axis) for name, axis in vocabulary.axes(solver.name).items()},
        "stages": solver.stages._asdict(),
        "fields": {name: quantities.attrs(name) for name in solver.fields},
        "default_fields": list(solver.default_fields),
        "presets": solver.presets,
        "preset_stages": solver.preset_stages,
        "portraits": {
            preset: {"href": link(f"/v1/solvers/{solver.name}/presets/{preset}/portrait.png"), **what}
            for preset, what in portraits.said(solver.name).items()
            if preset in solver.presets
        },
        "sizes": solver.sizes,
        "looks": solver.looks.to_json(),
        "qualities": {
            # an error that was never measured is null, not a guess
            name: {"relative_error": solver.tolerances.get(name), "resolution": resolution}
            for name, resolution in solver.default_resolution.items()
        },
        "session": _session(solver),
    }


def _session(solver: Solver) -> Json | None:
    if solver.live is None:
        return None
    actions = {name: action.model_json_schema() for name, action in solver.live.actions.items()}
    return {"address": link(f"/v1/sessions/{solver.name}"), "actions": actions, "fields": list(solver.live.fields)}


def _bounds(axis: vocabulary.Axis) -> Json:
    return {key: value for key, value in axis._asdict().items() if key != "name" and value is not None}


def _table(request: Request, info: TableInfo) -> Json:
    """Return what an asker needs to know of a table; the keys of its results stay inside.

    `neighbour_correlation` belongs to the stored stages, and `methods.judged` is the method whose errors the table
    knows: both are null where the table does not know.
    """
    solver = vocabulary.solver_named(info.solver)
    described = vocabulary.axes(info.solver)
    axes = {}
    for name, (low, high) in info.axes.items():
        axis = described.get(name)
        axes[name] = {
            "lowest": low,
            "highest": high,
            "units": axis.units if axis else "1",
            "description": axis.description if axis else name,
        }
    stage = solver.stages
    lowest, highest = info.reach
    live: LiveTables = request.app.state.tables
    judged = live.judged(info)
    return {
        "name": info.name,
        "solver": info.solver,
        "solver_version": info.version,
        "digest": info.digest,
        "created": info.created,
        "samples": info.samples,
        "resolution": info.resolution,
        "max_resolution": request.app.state.settings.max_resolution,
        "dtype": info.dtype,
        "axes": axes,
        "fixed": info.fixed,
        "stage": {
            "symbol": stage.symbol,
            "long_name": stage.long_name,
            "units": stage.units,
            "lowest": lowest,
            "highest": highest,
            "stored": info.stages,
            "neighbour_correlation": judged.neighbour_correlation,
        },
        "methods": {"default": methods.DEFAULT, "known": methods.OFFERED, "judged": judged.method},
        "descriptors": {name: quantities.attrs(name) for name in info.descriptors if name in quantities.QUANTITIES},
        "links": {
            "self": link(f"/v1/tables/{info.name}"),
            "shapes": link(f"/v1/shapes/{info.solver}?table={info.name}"),
        },
    }
