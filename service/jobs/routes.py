"""`/v1/jobs`: ask for a run of any solver, see how far it is, take it back."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path as FilePath
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Path, Query, Request, Response

from store.errors import StoreError, UnknownJob
from store.keys import is_key
from store.ledger.jobs import Job
from store.ledger.jobs import State as JobState
from store.ledger.ledger import Ledger
from store.ledger.queue import Queue
from store.store import Store
from store.tokens import Token

from .. import problems, vocabulary
from ..errors import Forbidden, JobEnded, JobFailed, NotDone
from ..security import requires
from ..views.addresses import link
from . import strict
from .submit import asker_of, submit
from .views import JobList, JobRequest, JobView, view

__all__ = ["JobId", "check_done", "ledger_of", "reading", "stored_job", "writing"]

#: Routes that need the scope read, and those that need run.
reading, writing = APIRouter(tags=["jobs"]), APIRouter(tags=["jobs"])

Runner = Annotated[Token, Depends(requires("run"))]
JobId = Annotated[str, Path(description="A job's id, as POST /v1/jobs returned it")]

_LOCATION: dict[str, Any] = {"Location": {"description": "Address of the job", "schema": {"type": "string"}}}


@writing.post(
    "/v1/jobs",
    summary="Ask for a run",
    status_code=202,
    response_model=JobView,
    responses={
        200: {"model": JobView, "description": "This was asked for before and has ended", "headers": _LOCATION},
        202: {"description": "The job waits or runs", "headers": _LOCATION},
        **problems.responses(400, 401, 403, 404, 409, 413, 422, 429, 503, 507),
    },
)
def ask(request: Request, response: Response, body: JobRequest, token: Runner) -> JobView:
    """Ask for a run of any solver. The same question is the same job: asking twice computes nothing twice.

    Parameters and need are checked by the solver itself before anything is queued. What was cancelled waits again; what
    was given up does with `again`.
    """
    solver = vocabulary.solver_named(body.solver)
    strict.check(solver, body.params)
    found = submit(
        request.app.state,
        solver,
        body.params,
        body.need,
        asker_of(request, token),
        preset=body.preset,
        again=body.again,
        unlimited=token.allows("admin"),
    )
    response.headers["Location"] = found.location
    if found.job.state in ("done", "failed"):
        response.status_code = 200
    return view(found.job)


@reading.get("/v1/jobs", summary="All jobs", responses=problems.responses(422, 503))
def jobs(
    request: Request,
    state: Annotated[JobState | None, Query(description="Only jobs in this state")] = None,
    limit: Annotated[int, Query(ge=1, le=200, description="Most jobs of one page")] = 50,
    after: Annotated[
        int | None, Query(ge=0, lt=2**63, description="Where the page goes on, as `next` of the page before has it")
    ] = None,
) -> JobList:
    """List jobs, newest first, page by page."""
    ledger = ledger_of(request)
    if ledger is None:
        return JobList(jobs=[], next=None)
    found, more = Queue(ledger).page(state, limit, after)
    following = None
    if more is not None:
        pairs = {"state": state, "limit": limit, "after": more}
        following = link(f"/v1/jobs?{urlencode({k: v for k, v in pairs.items() if v is not None})}")
    return JobList(jobs=[view(job, whole=False) for job in found], next=following)


@reading.get("/v1/jobs/{id}", summary="One job", responses=problems.responses(404, 503))
def job(request: Request, id: JobId) -> JobView:
    """Say how far a job is, and what went wrong if it failed."""
    return view(stored_job(request, id))


@writing.delete("/v1/jobs/{id}", summary="Cancel a job", responses=problems.responses(401, 403, 404, 409, 503, 507))
def cancel(request: Request, id: JobId, token: Runner) -> JobView:
    """Take a job back. It stops within a second, unless somebody else asked for it too: then it goes on for them.

    An administrator's word stops it for all. The answer leaves out the longest parameters, as lists do.
    """
    job = stored_job(request, id)
    ledger = ledger_of(request)
    assert ledger is not None  # else there were no such job
    if token.allows("admin"):
        ledger.cancel([id])
        job = ledger.get(id)
    else:
        job, mine = Queue(ledger).withdraw(id, token.id)
        if not mine and job.state != "cancelled":
            raise Forbidden("this job was asked for by others.", advice="A token with the scope admin can cancel it.")
    if job.state in ("done", "failed"):
        raise JobEnded(f"this job is {job.state} already.", advice="There is nothing to cancel.")
    return view(job, whole=False, noted=True)


def ledger_of(request: Request) -> Ledger | None:
    """Return the store's ledger, or None where none was ever begun: looking must not begin one.

    Raises:
        MissingStore: there is no store yet.

    """
    store: Store = request.app.state.tables.store
    return store.ledger if FilePath(store.ledger.path).is_file() else None


def stored_job(request: Request, key: str) -> Job:
    """Return a job.

    Raises:
        UnknownJob: nobody asked for it.

    """
    if is_key(key):
        store: Store = request.app.state.tables.store
        ledger = ledger_of(request)
        with suppress(UnknownJob):
            if ledger is not None:
                return ledger.get(key)
        # a result that came without the ledger, copied in or from before it was lost: GET /v1/results lists it
        with suppress(StoreError):
            if store.has(key) and store.learn([key]):
                return store.ledger.get(key)
    raise UnknownJob(f"there is no job {key[:80]!r}.", "GET /v1/jobs lists all.")


def check_done(job: Job) -> None:
    """Refuse a job that has no result.

    Raises:
        JobFailed: it was given up.
        NotDone: it waits, runs or was cancelled.

    """
    if job.state == "failed":
        error = job.error or {}
        raise JobFailed(
            f"this job failed: {error.get('message', 'nobody knows why.')}", advice=str(error.get("advice", ""))
        )
    if job.state == "cancelled":
        raise NotDone("this job was cancelled.", advice="Ask for it again with POST /v1/jobs.")
    if job.state != "done":
        raise NotDone(
            f"this job is {job.state} ({job.progress:.0%}).",
            advice=f"Follow /v1/jobs/{job.key}/events until it is done.",
        )
