"""From a request to a question understood: which table, which preset, which numbers, in which format."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from fastapi import Request

from solver.contract import InvalidInput, Solver, SolverError
from store.errors import StoreError
from store.families import stored
from store.families.choose import Families
from store.families.match import STAGE, Fit
from store.lookup import ShapeTable
from sweeps import families as covering

from .. import vocabulary
from ..errors import InvalidQuery, ServiceError, Wrong
from ..formats import Format, negotiate
from ..hours import timed
from ..settings import Settings
from . import detail as level
from . import naming
from .live import LiveTables
from .query import ShapeQuery, Words, parse

__all__ = ["Asked", "Found", "asked", "preset_of", "read", "table_for", "words_of"]

#: Where a request keeps which table answers it, and its question, or what is wrong with it.
_TABLE, _QUESTION = "wizen.table", "wizen.question"

#: The words of the tables in use, which one application serves with one limit.
_kept_words: WeakKeyDictionary[ShapeTable, Words] = WeakKeyDictionary()


class Found(NamedTuple):
    """The table for a question, and the numbers of its preset or defaults; where none holds it, `fits` are the nearest
    ones, and `said` the names of what the asker said.
    """

    name: str
    preset: str | None = None
    filled: Mapping[str, Any] = {}
    fits: tuple[Fit, ...] = ()
    said: Collection[str] = ()


class Asked(NamedTuple):
    """A question understood: what to look up where, and in which format to send it."""

    solver: Solver
    found: Found
    table: ShapeTable
    words: Words
    query: ShapeQuery
    detail: level.Detail
    chosen: Format
    resolution: int


def table_for(request: Request, solver: str) -> Found:
    """Return which table answers a request; read once for each.

    Raises:
        ServiceError, StoreError: there is no such solver, preset or table.

    """
    found = request.scope.get(_TABLE)
    if found is None:
        known, given = vocabulary.solver_named(solver), request.query_params
        tables: LiveTables = request.app.state.tables
        name, preset = given.get("table"), preset_of(known, given.get("preset"))
        if name is not None:
            tables.belongs(name, solver)
            found = Found(name, preset, {} if preset is None else tables.families(known).values({}, preset))
        else:
            said = naming.said(_items(request, known, preset), known)
            found = choose(tables.families(known), said, known.stages.symbol, preset)
        request.scope[_TABLE] = found
    assert isinstance(found, Found)
    return found


def choose(families: Families, said: Mapping[str, Any], symbol: str, preset: str | None) -> Found:
    """Return which of several tables holds the numbers and words that are said, the stage among them."""
    places, fixed = families.infos[0].places, families.infos[0].fixed
    known = {k: value for k, value in said.items() if k in places or k in fixed or isinstance(value, str)}
    stage = said.get(symbol)
    fit = families.choose(known, stage, preset)
    if fit is not None:
        return Found(fit.info.name, preset, families.filled(fit.info, preset))
    fits = tuple(families.nearest(known, stage, preset))
    return Found(fits[0].info.name, preset, families.filled(fits[0].info, preset), fits, tuple(known))


def _items(request: Request, solver: Solver, preset: str | None) -> list[tuple[str, str]]:
    """Return the items of a request's query by the names that tables use, the stage among them.

    Raises:
        InvalidQuery: no hours or fields could be read so.

    """
    return naming.named(timed(request.query_params.multi_items(), solver, preset), solver)


def preset_of(solver: Solver, name: str | None) -> str | None:
    """Return the name of a preset.

    Raises:
        InvalidQuery: the solver has none of that name.

    """
    if name is not None and name not in solver.presets:
        try:
            solver.parse({}, name[:40])
        except InvalidInput as error:
            raise InvalidQuery.of([Wrong("preset", error.message.rstrip("."), error.advice)]) from None
    return name


def asked(request: Request, solver: str) -> Asked:
    """Return the question of a request, read and checked once: the way in and the handler share what came of it.

    Raises:
        ServiceError, StoreError, SolverError: it cannot be understood, or there is no table for it.

    """
    found = request.scope.get(_QUESTION)
    if found is None:
        try:
            found = read(request, solver)
        except (ServiceError, StoreError, SolverError) as error:
            found = error
        request.scope[_QUESTION] = found
    if isinstance(found, Exception):
        raise found
    assert isinstance(found, Asked)
    return found


def read(request: Request, solver: str, only: Format | None = None, without: tuple[str, ...] = ()) -> Asked:
    """Return the question of a request, in the format asked for or in the `only` one, `without` some parameters.

    Raises:
        ServiceError, StoreError, SolverError: it cannot be understood, or there is no table for it.

    """
    settings: Settings = request.app.state.settings
    tables: LiveTables = request.app.state.tables
    given = request.query_params
    known = vocabulary.solver_named(solver)
    chosen = only or negotiate(request.headers.get("accept"), given.get("format"))
    found = table_for(request, solver)
    table = tables.get(found.name)
    words = _kept_words.get(table)
    if words is None:
        words = _kept_words.setdefault(table, words_of(known, table, settings.max_resolution, tables))
    detail = level.read(given)
    unknown = [Wrong(name, "means nothing here", f"Ask /v1/shapes/{solver}.") for name in without if name in given]
    also = [*unknown, *detail.refused(chosen)]
    items = _items(request, known, found.preset)
    query = parse(items, words, also, found.filled, beyond(found, words), found.preset)
    resolution = detail.resolution(query.resolution, table.resolution, settings.max_resolution)
    return Asked(known, found, table, words, query, detail, chosen, resolution)


def beyond(found: Found, words: Words) -> list[Wrong]:
    """Return how the nearest table is not the one that is asked for, where none is."""
    if not found.fits:
        return []
    near = found.fits[0]
    wrong = []
    for miss in (*near.misses, *near.unusual):
        name = words.stage if miss.name == STAGE else miss.name
        detail, advice = stored.describe(miss._replace(name=name), near.info)
        if name in words.ranges:
            advice = f"Take {name} from {words.say(name)}."  # with its units
        if found.preset is not None and miss.name in found.filled and miss.name not in found.said:
            advice = f"That is of the preset {found.preset}: choose another preset. {advice}"
        wrong.append(Wrong(name, detail, advice))
    return wrong


def words_of(solver: Solver, table: ShapeTable, max_resolution: int, tables: LiveTables) -> Words:
    """Return what may be asked of a table. Fixed parameters may be named too: plain numbers, and words.

    Raises:
        StaleTable: it is of another version of the solver.

    """
    stored.check_version(table.info, solver)
    fixed, made, units = covering.said(solver, table.info)
    texts = {k: v for k, v in table.fixed.items() if k.isidentifier() and isinstance(v, str)}
    # what a table says nothing of is as usual: parameters are written only where they differ
    texts = {**{k: v for k, v in naming.words(solver.params).items() if k not in table.fixed}, **texts}
    return Words(
        axes=table.axes,
        fixed=fixed,
        stage=solver.stages.symbol,
        stages=table.reach,
        units=units,
        max_resolution=max_resolution,
        tied=table.info.tied,
        made=made,
        shade=covering.shade(solver, table.info, tables.families(solver)),
        texts=texts,
    )
