"""From a shape that the table cannot give to the run that can: 303 to a job, or to its result once it is done.

Between table and run lies what the table gives, relaxed by its solver: a job as well, but a short one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

from fastapi import Request
from starlette.responses import Response

from solver.contract import InvalidInput, Need, Start
from store.errors import TooUncertain
from store.families.stored import document, refusal
from store.starter import is_starter
from sweeps.commands.terminal.tables import run_command
from sweeps.relaxing import lattice_of

from ..errors import OutsideRanges, Uncertain
from ..jobs.submit import asker_of, submit
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
#: The tables that come with wizen take no results.
_BY_HAND = "Run it by the command under links: this service stores nothing new."

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
        if len(near.misses) + len(near.unusual) > _MANY:
            # refusals one by one would lead, together, to another fruit
            whole = refusal(asked.found.fits)
            message, advice = whole.message, f"{whole.advice} {offer}"
        else:
            advice = f"The nearest table is {near.info.name!r}, {near.distance:.3g} away. {advice}"
    if isinstance(error, OutsideRanges):
        return OutsideRanges(message, advice=advice, wrong=error.wrong, more=more)
    return Uncertain(error.message, advice=advice, more=more)


def _ways(request: Request, asked: Asked) -> tuple[dict[str, str], str]:
    """Return the ways to a run of a question by their names, and which to go in words; none where no run can be."""
    try:
        params, preset = _run(asked)
        values = asked.solver.parse(params, preset)
        asked.solver.settle(_need(asked), preset, (values,))
    except InvalidInput as error:
        return {}, f"No run can be like that either: {error}"
    said = {name: value for name, value in asked.query.said.items() if name != asked.words.stage}
    links = {"command": run_command(asked.solver.name, asked.found.preset, said, asked.query.stage)}
    settings: Settings = request.app.state.settings
    if is_starter(settings.store):
        return links, _BY_HAND
    kept = [(name, text) for name, text in request.query_params.multi_items() if name != "exact"]
    address = link(request.scope["path"].removesuffix("/info"))
    return {"exact": f"{address}?{urlencode([*kept, ('exact', 'run')])}", **links}, _OFFER


def redirect(request: Request, asked: Asked) -> Response:
    """Ask for the run of a query in the name of the request's token, and send its asker there.

    Where the table holds the fruit, and only the point or the stage is off its axes, parameters that the query does
    not name are the table's, so that the run goes with its samples; else they are the preset's or the solver's
    defaults. The quality is `default`.

    Raises:
        Unauthorized, Forbidden: the request has no token for it.
        InvalidInput: the solver cannot compute it either.
        TooCostly, QueueFull, ReadOnlyStore: as for any job.

    """
    params, preset = _run(asked)
    return _sent(request, asked, params, _need(asked), preset)


def relax(request: Request, asked: Asked) -> Response:
    """Ask for what the table gives, relaxed by its solver, in the name of the request's token; send its asker there.

    The quality is that of the table's runs: on another mesh they are no equilibria, and slide away. The same shape of
    the same table is the same job: what was relaxed once is kept.

    Raises:
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
    token = authorize(request.app.state, bearer(request), "run")
    who, unlimited = asker_of(request, token), token.allows("admin")
    found = submit(request.app.state, asked.solver, params, need, who, preset=preset, unlimited=unlimited)
    location = found.location
    if found.job.state == "done":
        location += f"/result?{urlencode({'format': asked.chosen.name})}"
    return Response(status_code=303, headers={"Location": location, "Cache-Control": "no-store"})


def _need(asked: Asked) -> Need:
    """Return what is needed of the run of a question.

    Raises:
        InvalidInput: no run has such a stage.

    """
    return Need(stages=(asked.query.stage,), quality="default")


def _run(asked: Asked) -> tuple[Mapping[str, Any], str | None]:
    """Return the parameters of the run of a question, and the preset that they go over."""
    query, table = asked.query, asked.table.info
    if query.is_elsewhere:
        return {name: value for name, value in query.said.items() if name != asked.words.stage}, asked.found.preset
    return {**table.template, **table.complete(query.point), **query.named}, None
