"""`GET /v1/results`: what the store holds, page by page, as `wizen results` lists it."""

from __future__ import annotations

from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field

from store.errors import CorruptShard
from store.store import Store
from sweeps import results as stored
from sweeps.errors import InvalidOption

from . import problems, vocabulary
from .errors import InvalidQuery, Wrong
from .views.addresses import link

__all__ = ["router"]

router = APIRouter(tags=["results"])


class ResultRow(BaseModel):
    """One stage of a run."""

    key: str = Field(description="The run's key: the id of its job")
    solver: str
    version: str = Field(description="Version of the solver")
    params: dict[str, float | str] = Field(description="Parameters of one value each, by the names that are swept")
    stage: float
    numbers: dict[str, float | bool | str | None] = Field(description="What the run says of this stage")
    links: dict[str, str]


class ResultList(BaseModel):
    """A page of results."""

    results: list[ResultRow]
    total: int = Field(description="Rows of all pages")
    next: str | None = Field(description="Address of the next page, if there is one")
    damaged: list[str] = Field(description="Keys of results that cannot be read, and are left out")


@router.get("/v1/results", summary="All results", responses=problems.responses(404, 414, 422, 503))
def results(
    request: Request,
    solver: Annotated[str | None, Query(max_length=100, description="Only results of this solver")] = None,
    where: Annotated[
        list[str] | None, Query(max_length=20, description="Conditions that all hold, e.g. te<0.03")
    ] = None,
    sort: Annotated[str | None, Query(max_length=100, description="A name; -name puts the largest first")] = None,
    last: Annotated[bool, Query(description="Of each run, its last stage alone")] = False,
    limit: Annotated[int, Query(ge=1, le=500, description="Most rows of one page")] = 100,
    after: Annotated[int, Query(ge=0, lt=2**31, description="Rows before this page, as `next` has it")] = 0,
) -> ResultList:
    """List the stored results: one row per stage of each run, with its parameters and its numbers."""
    store: Store = request.app.state.tables.store
    damaged: dict[str, CorruptShard] = {}
    try:
        rows = stored.find(store, solver, where or (), sort, last, damaged)
    except InvalidOption as error:
        name = "where" if "--where" in error.message else "sort" if sort and sort[1:] in error.message else "where"
        detail = error.message.removeprefix("--where ").rstrip(".")
        raise InvalidQuery.of([Wrong(name, detail, error.advice)]) from None
    if solver is not None and not rows:
        vocabulary.solver_named(solver)  # results of a solver that is gone are still listed
    end = after + limit
    following = None
    if end < len(rows):
        pairs: dict[str, Any] = {"solver": solver, "where": where, "sort": sort, "last": last or None}
        known = {name: value for name, value in pairs.items() if value is not None}
        following = link(f"/v1/results?{urlencode({**known, 'limit': limit, 'after': end}, doseq=True)}")
    page = [_row(row) for row in rows[after:end]]
    return ResultList(results=page, total=len(rows), next=following, damaged=sorted(damaged))


def _row(row: stored.Row) -> ResultRow:
    finite = {name: None if value != value else value for name, value in row.numbers.items()}
    links = {"job": link(f"/v1/jobs/{row.key}"), "result": link(f"/v1/jobs/{row.key}/result")}
    return ResultRow(**{**row._asdict(), "numbers": finite}, links=links)
