"""From a shape that the table cannot give to the run that can: 303 to a job, or to its result once it is done."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlencode

from fastapi import Request
from starlette.responses import Response

from solver.contract import Need, Solver
from store.errors import TooUncertain
from store.lookup import ShapeTable

from ..errors import OutsideRanges
from ..formats import Format
from ..jobs.submit import asker_of, submit
from ..security import authorize, bearer
from .query import ShapeQuery

__all__ = ["RESPONSE", "offered", "redirect"]

#: What the OpenAPI page says of it.
RESPONSE: dict[str, Any] = {
    "description": "exact=run: the job that computes this shape, or its result once it is done",
    "headers": {"Location": {"description": "Address of the job or its result", "schema": {"type": "string"}}},
}

_OFFER = "With exact=run and a token of the scope run, the service runs exactly this."


def offered(error: OutsideRanges | TooUncertain) -> OutsideRanges | TooUncertain:
    """Return a refusal whose advice says that the shape can be run."""
    advice = f"{error.advice} {_OFFER}".strip()
    if isinstance(error, OutsideRanges):
        return OutsideRanges(error.message, advice=advice, wrong=error.wrong)
    return TooUncertain(error.message, advice)


def redirect(request: Request, solver: Solver, table: ShapeTable, query: ShapeQuery, chosen: Format) -> Response:
    """Ask for the run of a query in the name of the request's token, and send its asker there.

    Parameters that the query does not name are the table's; the quality is `default`.

    Raises:
        Unauthorized, Forbidden: the request has no token for it.
        InvalidInput: the solver cannot compute it either.
        TooCostly, QueueFull, ReadOnlyStore: as for any job.

    """
    token = authorize(request.app.state, bearer(request), "run")
    params = {**table.info.template, **query.named, **query.point}
    need = Need(stages=(query.stage,), quality="default")
    found = submit(request.app.state, solver, params, need, asker_of(request, token), unlimited=token.allows("admin"))
    location = found.location
    if found.job.state == "done":
        location += f"/result?{urlencode({'format': chosen.name})}"
    return Response(status_code=303, headers={"Location": location, "Cache-Control": "no-store"})
