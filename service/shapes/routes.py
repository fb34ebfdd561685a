"""`GET /v1/shapes/{solver}`: one interpolated shape in the representation that the asker prefers."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from solver import __version__
from store.canonical import canonical
from store.errors import TooUncertain

from .. import problems
from ..errors import OutsideRanges
from ..formats import FORMATS, Format
from ..settings import Settings
from ..views.addresses import link
from ..views.shape import ShapePage
from ..views.tags import matches
from . import asking, exact
from . import detail as level
from .answers import Answer, Answers
from .asking import Asked
from .compiling import NotAtOnce
from .query import ShapeQuery

__all__ = ["at_once", "router"]

router = APIRouter(tags=["shapes"])

#: Formats and largest lattice [colatitudes] of shapes that take less time than to hand them to another thread and wait
#: for the interpreter there.
_QUICK = ("points", "npz", "json")
_SMALL = 128
#: Says of a request that its shape turned out not to be computed at once.
_FOLDS = "wizen.folds"

_CONTENT = problems.files(f.media_type for f in FORMATS.values() if f.name != "json")


@router.get(
    "/v1/shapes/{solver}",
    summary="One shape, interpolated from a table",
    response_class=Response,
    responses={
        200: {"model": ShapePage, "description": "The shape, in the format asked for", "content": _CONTENT},
        303: exact.RESPONSE,
        304: {"description": "The shape that the asker has is the current one"},
        **problems.responses(401, 403, 404, 406, 409, 413, 414, 422, 429, 500, 503, 507),
    },
)
async def shape(
    request: Request, solver: str = Path(description="Name of a solver; GET /v1/solvers lists them")
) -> Response:
    """Interpolate the table at a point of its axes and a stage.

    Lengths are in units of the reference radius r1. The representation follows `format`, or else `Accept`. Formats
    without triangles (npz, points) say in `lattice` which points make one: a quad's corners a, b in a row and c, d in
    the next are the triangles (a, b, c) and (b, d, c). `volume` and `crossings` are measured on that mesh,
    `descriptors` on the runs behind it. points are little-endian: `WIZP`, the version 1, n and the length of the JSON
    that follows (three uint32), that JSON, then float32 x, y, z of n rows of 2n points, and of the north and the south
    pole.

    Every answer says what error to expect (`expected_error`, by measure) and whether it lies between the runs
    (`inside`); `max_error` refuses what is worse, and `exact=run` with a token runs what is refused or off the table;
    `exact=relax` brings what is looked up into balance. `Wizen-Tier` says of each answer whether it is looked up in a
    `table`, `relaxed` from there, or a `run`.
    """
    found = await at_once(request, solver)
    return await run_in_threadpool(_shape, request, solver) if found is None else found


@router.get(
    "/v1/shapes/{solver}/info",
    summary="The numbers about one shape",
    response_model=ShapePage,
    responses={
        304: {"description": "What the asker has is current"},
        **problems.responses(404, 409, 413, 414, 422, 500, 503),
    },
)
def info(request: Request, solver: str = Path(description="Name of a solver; GET /v1/solvers lists them")) -> Response:
    """Say what is known of a shape, as `format=json` does of the same question: always JSON, whatever is accepted."""
    return _settle(request, asking.read(request, solver, FORMATS["json"], ("format", "exact")))


async def at_once(request: Request, solver: str) -> Response | None:
    """Return a shape that is computed in the event loop, in its turn; None for what is better done in a thread.

    Raises:
        ServiceError, StoreError, SolverError: as `asking.read` and `_settle`, or too many wait already.

    """
    if _FOLDS in request.scope or not request.app.state.tables.is_open(asking.table_for(request, solver).name):
        return None  # opening a large table takes seconds
    asked = asking.asked(request, solver)
    # a shape is small, and no job is to be asked for
    if asked.resolution > _SMALL or asked.chosen.name not in _QUICK or asked.query.exact:
        return None
    async with request.app.state.turns:
        try:
            return _settle(request, asked)
        except NotAtOnce:
            request.scope[_FOLDS] = True  # putting it out of contact with itself takes longer than all the rest
            return None


def _shape(request: Request, solver: str) -> Response:
    return _settle(request, asking.asked(request, solver))


def _settle(request: Request, asked: Asked) -> Response:
    """Return the shape, or send its asker to the run of it."""
    try:
        if asked.query.outside:
            raise OutsideRanges.of(asked.query.outside)
        # the fresh shape is in balance as it is
        if asked.query.exact == "relax" and asked.query.stage != 0:
            return exact.relax(request, asked)
        return _answer(request, asked)
    except (OutsideRanges, TooUncertain) as error:
        if asked.query.exact != "run":
            raise exact.offered(request, asked, error) from None
        return exact.redirect(request, asked)


def _answer(request: Request, asked: Asked) -> Response:
    """Return the shape, or that the asker has it already.

    Raises:
        TooUncertain: it would be worse than the query allows.

    """
    settings: Settings = request.app.state.settings
    answers: Answers = request.app.state.answers
    solver, found, table, words, query, detail, chosen, resolution = asked
    name = found.name
    tag = _tag(chosen, name, table.digest, query, resolution, *detail.key)
    headers = {
        "ETag": tag,
        "Cache-Control": settings.kept(settings.cache_age),
        "Vary": "Accept",
        "Wizen-Tier": "table",
    }
    held = request.headers.get("if-none-match", "")
    kept = answers.get(tag)
    # whether there is any shape at all is known when it is looked up
    if matches(held, tag, there=kept is not None):
        return Response(status_code=304, headers=headers)
    if kept is not None:
        answers.remember(request.scope, solver, name, request.app.state.tables.families(solver), table.digest, tag)
        return _Whole(kept)

    begin = time.perf_counter()
    shape = table.at(
        query.point,
        query.stage,
        resolution=resolution,
        fields=detail.of(chosen),
        method=query.method,
        max_error=query.max_error,
        window=detail.window,
    )
    looked = time.perf_counter()
    if matches(held, tag):
        return Response(status_code=304, headers=headers)
    is_json = chosen.name == "json"  # its timings and its links are this request's own
    about = words.about(
        solver.name,
        name,
        detail=detail.said(resolution, table.resolution),
        links=_links(request, resolution, detail) if is_json else {},
        timings={"lookup": 1e3 * (looked - begin)} if is_json else {},
        metres=solver.metres(table.at_parameters(query.point)) if chosen.name == "glb" else None,
    )
    body = chosen.encode(shape, about)
    encoded = time.perf_counter()
    timing = f"lookup;dur={1e3 * (looked - begin):.3f}, encode;dur={1e3 * (encoded - looked):.3f}"
    if is_json:
        return Response(body, headers={**headers, "Server-Timing": timing}, media_type=chosen.media_type)
    headers["Content-Disposition"] = f'attachment; filename="{_file(solver.name, name, query, words.stage, chosen)}"'
    wire = _wire({**headers, "Content-Type": chosen.media_type, "Content-Length": str(len(body))})
    made = Answer(tag, (*wire, (b"server-timing", b"kept;desc=answered-before")), body)
    answers.keep(made)
    answers.remember(request.scope, solver, name, request.app.state.tables.families(solver), table.digest, tag)
    return _Whole(Answer(tag, (*wire, (b"server-timing", timing.encode("latin-1"))), body))


class _Whole(Response):
    """An answer as a response, whose headers are complete: none of them is made anew."""

    def __init__(self, answer: Answer) -> None:
        self.status_code, self.background = 200, None
        self.body, self.raw_headers = answer.body, list(answer.headers)


def _wire(headers: Mapping[str, str]) -> tuple[tuple[bytes, bytes], ...]:
    """Return headers as they go on the wire."""
    return tuple((key.lower().encode("latin-1"), value.encode("latin-1")) for key, value in headers.items())


def _tag(chosen: Format, name: str, digest: str, query: ShapeQuery, resolution: int, *detail: str) -> str:
    """Return the entity tag; JSON carries timings, so its bytes differ and its tag is a weak one."""
    words = [__version__, chosen.name, name, digest, query.point, query.stage, resolution, *detail]
    words += [query.method, query.max_error]
    text = hashlib.sha256(canonical(words)).hexdigest()[:32]
    return f'W/"{text}"' if chosen.name == "json" else f'"{text}"'


def _links(request: Request, resolution: int, detail: level.Detail) -> dict[str, str]:
    """Return the addresses of this shape's other representations that can hold it, relative to this host."""
    settled = ("format", "resolution", "screen_px", "distance", "fov")
    kept = [(k, v) for k, v in request.query_params.multi_items() if k not in settled]
    others = [name for name, chosen in FORMATS.items() if name != "json" and not detail.refused(chosen)]
    pairs = [*kept, ("resolution", str(resolution))]
    path = link(request.scope["path"].removesuffix("/info"))
    return {name: f"{path}?{urlencode([*pairs, ('format', name)])}" for name in others}


def _file(solver: str, table: str, query: ShapeQuery, symbol: str, chosen: Format) -> str:
    numbers: Mapping[str, float] = {**query.point, symbol: query.stage}
    # fruits of several families have the same numbers
    whose = [solver] if table == "default" else [solver, table]
    return "-".join([*whose, *(f"{name}{value:g}" for name, value in numbers.items())]) + chosen.suffix
