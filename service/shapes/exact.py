"""From a shape that the table cannot give to the run that can: 303 to a job, or to its result once it is done.

Between table and run lies what the table gives, relaxed by its solver: a job as well, but a short one.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any, NamedTuple
from urllib.parse import urlencode

from fastapi import Request
from starlette.responses import Response

from solver.contract import InvalidInput, Need, Params, SolverError, Start
from store.errors import OutsideTable, TooUncertain
from store.families.stored import called, document, refusal
from store.starter import is_starter
from store.surfaces.window import WHOLE
from sweeps.relaxing import lattice_of

from ..errors import InvalidQuery, OutsideRanges, Uncertain, Wrong
from ..jobs.submit import asker_of, check_begun, submit
from ..security import authorize, bearer
from ..settings import Settings
from ..views.addresses import link
from .asking import Asked

__all__ = ["RESPONSE", "offered", "redirect", "relax"]

#: What the OpenAPI page says of it.
RESPONSE: dict[str, Any] = {
    "description": "exact=run or relax: the job that computes this shape, or its result once it is done",
    "headers": {"Location": {"description": "Address of the job or its result", "schema": {"type": "string"}}},
}

_OFFER = "With exact=run and a token of the scope run, the service runs exactly this."
_WHOLE = "With exact=run and a token of the scope run, the service runs this fruit, whole."
#: The tables that come with wizen take no results.
_BY_HAND = "Run it by the command under links: this service stores nothing new."
_WITHOUT = "The table's runs have {} besides, which that command cannot have: its wrinkles come to lie elsewhere."

#: Parameters that a refusal tells one by one.
_MANY = 3


def offered(request: Request, asked: Asked, error: OutsideRanges | TooUncertain) -> OutsideRanges | Uncertain:
    """Return a refusal that says which table is the nearest, and how the shape can be run."""
    links, offer = _ways(request, asked)
    advice = f"{error.advice} {offer}".strip()
    more: dict[str, Any] = {"links": links} if links else {}
    message = error.message
    if asked.found.fits:
        near = asked.found.fits[0]
        more["nearest"] = document(near)
        missed = [miss.name for miss in (*near.misses, *near.unusual)]
        if len(missed) > _MANY or not near.info.tied.keys().isdisjoint(missed):
            # refusals one by one would lead, together, to another fruit
            whole = refusal(asked.found.fits)
            message, advice = whole.message, f"{whole.advice} {offer}"
        else:
            which = called(asked.found.fits).capitalize()
            advice = f"{which} table is {near.info.name!r}, {near.distance:.3g} away. {advice}"
    if isinstance(error, OutsideRanges):
        return OutsideRanges(message, advice=advice, wrong=error.wrong, more=more)
    return Uncertain(error.message, advice=advice, more=more)


def _ways(request: Request, asked: Asked) -> tuple[dict[str, str], str]:
    """Return the ways to a run of a question by their names, and which to go in words; none where no run can be.

    All of them lead to one run: a command that cannot be that one is offered where there is no other way, and told of.
    """
    try:
        params, preset = _run(asked)
    except OutsideTable as error:
        return {}, f"No run is offered: {error}"
    try:
        values = asked.solver.parse(params, preset)
        asked.solver.settle(_need(asked), preset, (values,))
        check_begun(request.app.state.tables.store, values.model_dump(mode="json"))
    except InvalidInput as error:
        return {}, f"No run can be like that either: {error}"
    typed = _command(asked, values)
    settings: Settings = request.app.state.settings
    if is_starter(settings.store):
        lacks = " and ".join(typed.lacks)
        return {"command": typed.text}, f"{_BY_HAND} {_WITHOUT.format(lacks)}" if lacks else _BY_HAND
    parts = {wrong.name for wrong in _parts(asked)}
    kept = [(name, text) for name, text in request.query_params.multi_items() if name not in {"exact", *parts}]
    address = link(request.scope["path"].removesuffix("/info"))
    links = {"exact": f"{address}?{urlencode([*kept, ('exact', 'run')])}"}
    return links if typed.lacks else {**links, "command": typed.text}, _WHOLE if parts else _OFFER


def _parts(asked: Asked) -> list[Wrong]:
    """Return which parts of a shape are asked for, that are looked up alone: a job's result is sent whole."""
    given = {"region": asked.detail.region, "components": asked.detail.window.components != WHOLE.components}
    # JSON measures positions, which a result has in any case
    given["fields"] = asked.detail.fields is not None and asked.chosen.name != "json"
    advice = "Leave it out, or leave exact out: a looked-up shape can be sent in part."
    detail = "is of looked-up shapes, and exact leads to a whole one"
    return [Wrong(name, detail, advice) for name, is_it in given.items() if is_it]


def redirect(request: Request, asked: Asked) -> Response:
    """Ask for the run of a query in the name of the request's token, and send its asker there.

    Where the table holds the fruit, and only the point or the stage is off its axes, parameters that the query does
    not name are the table's, so that the run goes with its samples; else they are the preset's or the solver's
    defaults. The quality is `default`.

    Raises:
        InvalidQuery: a part of it is asked for.
        Unauthorized, Forbidden: the request has no token for it.
        InvalidInput: the solver cannot compute it either.
        OutsideTable: nobody knows what goes with an axis of the table there.
        TooCostly, QueueFull, ReadOnlyStore: as for any job.

    """
    params, preset = _run(asked)
    return _sent(request, asked, params, _need(asked), preset)


def relax(request: Request, asked: Asked) -> Response:
    """Ask for what the table gives, relaxed by its solver, in the name of the request's token; send its asker there.

    The quality is that of the table's runs: on another mesh they are no equilibria, and slide away. The same shape of
    the same table is the same job: what was relaxed once is kept.

    Raises:
        InvalidQuery: a part of it is asked for.
        Unauthorized, Forbidden: the request has no token for it.
        InvalidInput: the solver relaxes nothing.
        StaleTable: the table is of another version of the solver.
        TooCostly, QueueFull, ReadOnlyStore: as for any job.

    """
    table, query = asked.table, asked.query
    need = Need(
        stages=(query.stage,),
        quality=table.info.quality,
        resolution=asked.resolution,
        start=Start(table=asked.found.name, digest=table.digest, method=query.method, lattice=lattice_of(table)),
    )
    return _sent(request, asked, table.at_parameters(query.point), need, None)


def _sent(request: Request, asked: Asked, params: Mapping[str, Any], need: Need, preset: str | None) -> Response:
    """Submit a job in the name of the request's token, and send its asker there."""
    parts = _parts(asked)
    if parts:
        raise InvalidQuery.of(parts)
    token = authorize(request.app.state, bearer(request), "run")
    who, unlimited = asker_of(request, token), token.allows("admin")
    found = submit(request.app.state, asked.solver, params, need, who, preset=preset, unlimited=unlimited)
    location = found.location
    if found.job.state == "done":
        location += f"/result?{urlencode({'format': asked.chosen.name})}"
    return Response(status_code=303, headers={"Location": location, "Cache-Control": "no-store"})


class _Command(NamedTuple):
    """What to type; `lacks` names parameters of the run that no command line can say."""

    text: str
    lacks: tuple[str, ...]


def _need(asked: Asked) -> Need:
    """Return what is needed of the run of a question.

    Raises:
        InvalidInput: no run has such a stage.

    """
    return Need(stages=(asked.query.stage,), quality="default")


def _run(asked: Asked) -> tuple[Mapping[str, Any], str | None]:
    """Return the parameters of the run of a question, and the preset that they go over.

    What follows an axis of the table goes with it, unless the asker meant no table.

    Raises:
        OutsideTable: nobody knows what goes with an axis there.

    """
    query, table = asked.query, asked.table.info
    if not query.is_elsewhere:
        over = {**query.point, **table.following(query.point, query.named), **query.named}
        return asked.solver.params.over(table.template, over), None
    said = _said(asked)
    if not asked.found.fits and asked.found.preset is None:
        said |= table.following({name: query.point[name] for name in table.axes if name in said}, said)
    return said, asked.found.preset


def _command(asked: Asked, run: Params) -> _Command:
    """Return the command that solves what `_run` says, to the same key.

    It names the preset and what was said, and then what the table's runs have besides. What refers to another run, as a
    pattern does, takes a store, which `wizen solve` has none of.
    """
    wanted = run.full()
    preset, said = asked.found.preset, _said(asked)
    try:
        near = asked.solver.parse(said, preset)
    except SolverError:
        # only with what the table says besides is it a fruit
        preset, said, near = None, {}, asked.solver.parse({})
    known = near.full()
    rest = {name: value for name, value in wanted.items() if value != known[name]}
    lacks = tuple(name for name, value in rest.items() if isinstance(value, Mapping))
    # a whole field goes before its entries, which are said by their axes
    over = {axis for axis, (field, _) in asked.solver.params.axes.items() if field in rest}
    values = {name: value for name, value in said.items() if name not in over} | rest
    words = ["wizen", "solve", asked.solver.name, *(["--preset", preset] if preset else [])]
    for name, value in values.items():
        if name not in lacks:
            words += ["--set", f"{name}={_written(value)}"]
    return _Command(shlex.join([*words, "--stages", _number(asked.query.stage), "--out", "shape.h5"]), lacks)


def _said(asked: Asked) -> dict[str, Any]:
    return {name: value for name, value in asked.query.said.items() if name != asked.words.stage}


def _written(value: Any) -> str:
    """Return a value as `--set` reads it back, to the last digit."""
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, list) and value and all(isinstance(one, float | int) for one in value):
        return ",".join(map(_written, value))
    return value if isinstance(value, str) and value.isalpha() else json.dumps(value)


def _number(value: float) -> str:
    short = f"{value:.15g}"
    return short if float(short) == value else repr(value)
