"""`POST /v1/shapes:batch`: many shapes of one table in one request, for pipelines.

One address for all solvers, with the solver in the body, as for jobs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response, StreamingResponse

from solver.contract import Solver, SolverError
from store.errors import StoreError, TooUncertain
from store.lookup import ShapeTable
from store.shape import Shape

from .. import problems, vocabulary
from ..errors import BatchTooLarge, InvalidQuery, OutsideRanges, UncertainBatch, Wrong
from ..formats import About
from ..settings import Settings
from . import batch_detail, batch_formats
from . import detail as level
from .asking import Found, beyond, choose, preset_of, words_of
from .batch_detail import Asked
from .batch_formats import Batch
from .batch_request import BatchRequest, counted, expand
from .live import LiveTables
from .query import RESERVED, ShapeQuery, Words, method_of, parse

__all__ = ["router"]

router = APIRouter(tags=["shapes"])

#: Bytes up to which an answer is made before any of it is sent; a longer one is streamed in pieces of this size.
_PIECE = 1 << 20
_CONTENT = problems.files(batch_formats.MEDIA_TYPES)


@router.post(
    "/v1/shapes:batch",
    summary="Many shapes, interpolated from one table",
    response_class=Response,
    responses={
        200: {"description": "The shapes, in the order asked for", "content": _CONTENT},
        **problems.responses(400, 404, 406, 409, 413, 422, 500, 503),
    },
)
def batch(request: Request, body: BatchRequest) -> Response:
    """Interpolate one table at many points and stages, at one level of detail or at each point's own.

    `npz` is one archive with a leading axis over the shapes, `json` one line per shape, the others one part per shape
    of a multipart/mixed body. Everything is checked before anything is computed, and every wrong entry named. What is
    asked for twice is computed once, and with `once` sent once.
    """
    settings: Settings = request.app.state.settings
    tables: LiveTables = request.app.state.tables
    solver = vocabulary.solver_named(body.solver)
    chosen = batch_formats.negotiate(request.headers.get("accept"), body.format)
    # before anything is made of them: to choose a family takes its time for every shape
    _check_count(counted(body.points), settings)
    entries = expand(body.points)
    found = _table(tables, solver, body, entries)
    name, table = found.name, tables.get(found.name)
    words = words_of(solver, table, settings.max_resolution, tables)
    detail = level.read(body.detail)
    # what is wrong with all of them is said first, and alone: it would hide what is wrong with some
    wrong = [*detail.refused(chosen), *_off(body, settings), *_unknown_method(body.method)]
    if wrong:
        raise InvalidQuery.of(wrong)
    levels, off = batch_detail.levels(entries, body, table.resolution, settings.max_resolution)
    asked = [Asked(q, *at) for q, at in zip(_queries(entries, words, found, off), levels, strict=True)]
    if chosen.name == "npz" and len({one.resolution for one in asked}) > 1:
        advice = "Ask for glb, obj, points or json, or for one batch for each lattice."
        raise InvalidQuery.of([Wrong("points", "are of several lattices, which one npz cannot hold", advice)])
    distinct, rows = batch_detail.distinct(asked)
    sent = distinct if body.once else asked
    _check_size(detail, [one.resolution for one in sent], settings)
    queries = [one.query for one in distinct]
    # of an archive, positions: the other half of it only for those who name it
    fields = ("position",) if chosen.name == "npz" and detail.fields is None else detail.of(chosen)
    _check_shapes(table, queries, rows, "position" in fields)
    options: dict[str, Any] = {} if body.method is None else {"method": body.method}
    if body.max_error is not None:
        _check_trust(table, queries, rows, {**options, "max_error": body.max_error})

    def at(one: Asked) -> Shape:
        point, stage = one.query.point, one.query.stage
        return table.at(point, stage, resolution=one.resolution, fields=fields, window=detail.window, **options)

    def about_one(one: Asked) -> About:
        metres = solver.metres(table.at_parameters(one.query.point)) if chosen.name == "glb" else None
        return replace(about, detail=one.said, metres=metres)

    def look_up() -> Iterator[tuple[Shape, About]]:
        yield from batch_detail.each_once(distinct, sent, at, about_one)

    about = words.about(body.solver, name)
    rest = (rows if body.once else None, detail.window, fields, look_up)
    made = Batch(table, replace(about, detail=sent[0].said), sent, *rest)
    return _answer(batch_formats.encode(chosen, made), batch_formats.media_type(chosen, made))


def _table(tables: LiveTables, solver: Solver, body: BatchRequest, entries: list[Mapping[str, float]]) -> Found:
    """Return the table that holds all entries, or else the one nearest to the first that is held by another.

    Raises:
        UnknownTable: there is none of that name, or none at all.
        InvalidQuery: there is no such preset.

    """
    preset = preset_of(solver, body.preset)
    if body.table is not None:
        tables.belongs(body.table, solver.name)
        filled = {} if preset is None else tables.families(solver).values({}, preset)
        return Found(body.table, preset, filled)
    families = tables.families(solver)
    found = [choose(families, entry, solver.stages.symbol, preset) for entry in entries]
    best = found[0]
    for one in {one.name: one for one in found}.values():
        # of those that answer some entry, one that answers all
        only = families.only(one.name)
        if all(not choose(only, entry, solver.stages.symbol, preset).fits for entry in entries):
            best = one
    return best


def _answer(parts: Iterator[bytes], media_type: str) -> Response:
    """Return an answer with its length if it is short, else a stream, which holds no more than a piece of it."""
    pieces = _gather(parts)
    first = next(pieces, b"")
    if len(first) < _PIECE:
        return Response(first, media_type=media_type)
    return StreamingResponse(chain([first], pieces), media_type=media_type)


def _gather(parts: Iterator[bytes]) -> Iterator[bytes]:
    """Join parts to pieces, all but the last of them of at least `_PIECE` bytes."""
    held: list[bytes] = []
    size = 0
    for part in parts:
        held.append(part)
        size += len(part)
        if size >= _PIECE:
            yield b"".join(held)
            held, size = [], 0
    if held:
        yield b"".join(held)


def _check_count(count: int, settings: Settings) -> None:
    """Refuse too many shapes.

    Raises:
        BatchTooLarge: naming the limit.

    """
    if count > settings.max_batch:
        advice = f"Send at most {settings.max_batch} at once; an operator raises the limit with WIZEN_MAX_BATCH."
        raise BatchTooLarge.of([Wrong("points", f"{count} shapes are more than {settings.max_batch}", advice)])


def _check_size(detail: level.Detail, resolutions: list[int], settings: Settings) -> None:
    """Refuse what is too much for one answer.

    Raises:
        BatchTooLarge: naming the limit.

    """
    sizes = {n: detail.window.on(n) for n in set(resolutions)}
    points = sum(sizes[n].height * sizes[n].width for n in resolutions)
    if points > settings.max_batch_samples:
        most = len(resolutions) * settings.max_batch_samples // points
        advice = (
            f"At this resolution send at most {most} shapes at once; "
            "an operator raises the limit with WIZEN_MAX_BATCH_SAMPLES."
        )
        large = sizes[max(resolutions)]
        said = f"{len(resolutions)} shapes of up to {large.height} x {large.width} points are {points}, more than"
        raise BatchTooLarge.of([Wrong("points", f"{said} {settings.max_batch_samples}", advice)])


def _unknown_method(name: str | None) -> list[Wrong]:
    found = method_of(name) if name is not None else ""
    return [found] if isinstance(found, Wrong) else []


def _off(body: BatchRequest, settings: Settings) -> list[Wrong]:
    if body.resolution is None or body.resolution <= settings.max_resolution:
        return []
    detail = f"{body.resolution} colatitude samples are more than {settings.max_resolution}"
    return [Wrong("resolution", detail, "An operator raises the limit with WIZEN_MAX_RESOLUTION.")]


def _queries(entries: list[Mapping[str, float]], words: Words, found: Found, off: list[Wrong]) -> list[ShapeQuery]:
    """Return the questions of all entries; `off` is what is wrong with their levels of detail.

    Raises:
        OutsideRanges: listing every number off its axis, where nothing else is wrong.
        InvalidQuery: listing all that is wrong with any entry.

    """
    wrong: list[Wrong] = list(off)
    queries, only_outside = [], not off
    numbers = words._replace(texts={})  # points hold no words
    for i, entry in enumerate(entries):
        own = {name: value for name, value in entry.items() if name not in batch_detail.NAMES}
        common = [Wrong(n, "is not a parameter of one shape", "Give it for all.") for n in RESERVED if n in own]
        try:
            items = [(name, repr(value)) for name, value in own.items()]
            how = (found.filled, beyond(found, words), found.preset, batch_detail.NAMES)
            query = parse(items, numbers, common, *how)
        except InvalidQuery as error:
            only_outside = False
            wrong += batch_detail.entry(i, error.wrong)
        else:
            wrong += batch_detail.entry(i, query.outside)
            queries.append(query)
    if wrong:
        raise batch_detail.summed(OutsideRanges if only_outside else InvalidQuery, wrong)
    return queries


def _check_shapes(table: ShapeTable, queries: list[ShapeQuery], rows: list[int], wanted: bool) -> None:
    """Refuse points where no shape exists though every number is on its axis; `rows` as in `batch_detail.distinct`.

    Raises:
        InvalidQuery: listing them.

    """
    wrong: dict[int, Wrong] = {}
    for row, query in enumerate(queries if wanted else []):
        try:
            table.fresh(query.point)
        except SolverError as error:
            wrong[row] = Wrong("", error.message, error.advice)
    if wrong:
        raise batch_detail.summed(InvalidQuery, _of_points(wrong, rows))


def _check_trust(table: ShapeTable, queries: list[ShapeQuery], rows: list[int], options: Mapping[str, Any]) -> None:
    """Refuse shapes that may be too far off; `rows` as in `batch_detail.distinct`.

    Raises:
        UncertainBatch: listing them.

    """
    wrong: dict[int, Wrong] = {}
    for row, query in enumerate(queries):
        try:
            table.at(query.point, query.stage, fields=(), **options)
        except TooUncertain as error:
            wrong[row] = Wrong("", *_said(error))
    if wrong:
        raise batch_detail.summed(UncertainBatch, _of_points(wrong, rows))


def _of_points(wrong: Mapping[int, Wrong], rows: list[int]) -> list[Wrong]:
    """Return what is wrong with distinct shapes under the numbers of all points that ask for them."""
    return [one for i, row in enumerate(rows) if row in wrong for one in batch_detail.entry(i, [wrong[row]])]


def _said(error: StoreError) -> tuple[str, str]:
    return error.message.rstrip("."), error.advice
