"""`GET /v1/shapes/{solver}`: one interpolated shape in the representation that the asker prefers."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Request
from starlette.responses import Response

from solver import __version__
from solver.contract import Solver
from store.canonical import canonical
from store.errors import TooUncertain
from store.lookup import ShapeTable

from . import detail as level
from . import exact, problems, vocabulary
from .errors import OutsideRanges
from .formats import FORMATS, About, Format, negotiate
from .live import LiveTables
from .query import ShapeQuery, Words, parse
from .settings import Settings

__all__ = ["router", "words_of"]

router = APIRouter(tags=["shapes"])

_BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
_CONTENT = {f.media_type: {"schema": {"type": "object"}} if f.name == "json" else _BINARY for f in FORMATS.values()}


@router.get(
    "/v1/shapes/{solver}",
    summary="One shape, interpolated from a table",
    response_class=Response,
    responses={
        200: {"description": "The shape", "content": _CONTENT},
        303: exact.RESPONSE,
        304: {"description": "The shape that the asker has is the current one"},
        **problems.responses(401, 403, 404, 406, 409, 413, 414, 422, 429, 500, 503, 507),
    },
)
def shape(request: Request, solver: str = Path(description="Name of a solver; GET /v1/solvers lists them")) -> Response:
    """Interpolate the table at a point of its axes and a stage.

    Lengths are in units of the reference radius r1. The representation follows `format`, or else `Accept`. Every answer
    says what error to expect (`expected_error`, by measure) and whether it lies between the runs (`inside`);
    `max_error` refuses what is worse, and `exact=run` with a token runs what is refused or off the table.
    """
    settings: Settings = request.app.state.settings
    tables: LiveTables = request.app.state.tables
    given = request.query_params
    known = vocabulary.solver_named(solver)
    chosen = negotiate(request.headers.get("accept"), given.get("format"))
    name = tables.choose(solver, given.get("table"))
    table = tables.get(name)
    words = words_of(known, table, settings.max_resolution)
    detail = level.read(given)
    query = parse(given.multi_items(), words, detail.refused(chosen))
    try:
        if query.outside:
            raise OutsideRanges.of(query.outside)
        return _answer(request, known, name, table, words, query, detail, chosen)
    except (OutsideRanges, TooUncertain) as error:
        if not query.exact:
            raise exact.offered(error) from None
        return exact.redirect(request, known, table, query, chosen)


def _answer(
    request: Request,
    solver: Solver,
    name: str,
    table: ShapeTable,
    words: Words,
    query: ShapeQuery,
    detail: level.Detail,
    chosen: Format,
) -> Response:
    """Return the shape, or that the asker has it already.

    Raises:
        TooUncertain: it would be worse than the query allows.

    """
    settings: Settings = request.app.state.settings
    resolution = detail.resolution(query.resolution, table.resolution, settings.max_resolution)
    tag = _tag(chosen, name, table.digest, query, resolution, *detail.key)
    headers = {
        "ETag": tag,
        "Cache-Control": f"{'public' if settings.public_read else 'private'}, max-age={settings.cache_age}",
        "Vary": "Accept",
    }
    if _matches(request.headers.get("if-none-match", ""), tag):
        return Response(status_code=304, headers=headers)

    begin = time.perf_counter()
    found = table.at(
        query.point,
        query.stage,
        resolution=resolution,
        fields=detail.of(chosen),
        method=query.method,
        max_error=query.max_error,
        window=detail.window,
    )
    looked = time.perf_counter()
    about = About(
        solver=solver.name,
        table=name,
        fixed=words.fixed,
        stage_symbol=words.stage,
        units=words.units,
        detail=detail.said(resolution, table.resolution),
        links=_links(request, resolution, detail) if chosen.name == "json" else {},
        timings={"lookup": 1e3 * (looked - begin)},
    )
    body = chosen.encode(found, about)
    encoded = time.perf_counter()
    headers["Server-Timing"] = f"lookup;dur={1e3 * (looked - begin):.3f}, encode;dur={1e3 * (encoded - looked):.3f}"
    if chosen.name != "json":
        headers["Content-Disposition"] = f'attachment; filename="{_filename(solver.name, query, words.stage, chosen)}"'
    return Response(body, headers=headers, media_type=chosen.media_type)


def words_of(solver: Solver, table: ShapeTable, max_resolution: int) -> Words:
    """Return what may be asked of a table. Fixed parameters may be named too: those that are plain numbers."""
    described = vocabulary.axes(solver.name)
    fixed = {k: float(v) for k, v in table.fixed.items() if k.isidentifier() and isinstance(v, int | float)}
    units = {name: described[name].units for name in (*table.axes, *fixed) if name in described}
    return Words(
        axes=table.axes,
        fixed=fixed,
        stage=solver.stages.symbol,
        stages=table.reach,
        units={**units, solver.stages.symbol: solver.stages.units},
        max_resolution=max_resolution,
    )


def _tag(chosen: Format, name: str, digest: str, query: ShapeQuery, resolution: int, *detail: str) -> str:
    """Return the entity tag; JSON carries timings, so its bytes differ and its tag is a weak one."""
    words = [__version__, chosen.name, name, digest, query.point, query.stage, resolution, *detail]
    words += [query.method, query.max_error]
    text = hashlib.sha256(canonical(words)).hexdigest()[:32]
    return f'W/"{text}"' if chosen.name == "json" else f'"{text}"'


def _matches(header: str, tag: str) -> bool:
    """Return whether an If-None-Match header names the tag; the comparison is the weak one, as RFC 9110 has it."""
    return tag.removeprefix("W/") in {part.strip().removeprefix("W/") for part in header.split(",")}


def _links(request: Request, resolution: int, detail: level.Detail) -> dict[str, str]:
    """Return the addresses of this shape's other representations that can hold it, relative to this host."""
    settled = ("format", "resolution", "screen_px", "distance", "fov")
    kept = [(k, v) for k, v in request.query_params.multi_items() if k not in settled]
    others = [name for name, chosen in FORMATS.items() if name != "json" and not detail.refused(chosen)]
    pairs = [*kept, ("resolution", str(resolution))]
    return {name: f"{request.url.path}?{urlencode([*pairs, ('format', name)])}" for name in others}


def _filename(solver: str, query: ShapeQuery, symbol: str, chosen: Format) -> str:
    numbers: Mapping[str, float] = {**query.point, symbol: query.stage}
    return "-".join([solver, *(f"{name}{value:g}" for name, value in numbers.items())]) + chosen.suffix
