"""`GET /v1/jobs/{id}/events`: a job's state and progress as server-sent events, until it ends.

Every event holds the whole job, so that a client that was away has missed nothing once it has the next one.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from functools import partial
from typing import Annotated, Any

import anyio
import anyio.to_thread
from fastapi import APIRouter, Header, Request
from starlette.responses import Response, StreamingResponse

from store.ledger.jobs import Job

from .. import problems
from ..errors import TooManyListeners
from ..limits.clients import client_of
from ..settings import Settings
from ..telemetry import HEAD
from .routes import JobId, stored_job
from .views import ENDED, view

__all__ = ["router"]

router = APIRouter(tags=["jobs"])

#: Seconds between two looks at a job, and after which silence is broken by a comment.
_LOOK, _HEARTBEAT = 0.25, 15.0
#: Seconds after which a stream ends and its client comes back: a service that stops need not wait for longer.
_LONGEST = 600.0
#: Milliseconds after which a client that lost its stream comes back.
_RETRY = 1000

_TEXT = {"type": "string"}
#: One event, with the job as JSON in `data`.
_EVENT: dict[str, Any] = {
    "type": "object",
    "properties": {"id": _TEXT, "event": _TEXT, "data": _TEXT, "retry": {"type": "integer"}},
}
_STREAM: dict[str, Any] = {
    "description": "Events `state` and `progress`, each with the job as GET /v1/jobs/{id} has it; the last one has a "
    "state that is done, failed or cancelled",
    "content": {"text/event-stream": {"schema": _EVENT}},
}


@router.get(
    "/v1/jobs/{id}/events",
    summary="Follow a job",
    response_class=Response,
    responses={
        200: _STREAM,
        204: {"description": "The client that comes back has seen the last event"},
        **problems.responses(404, 422, 429, 503),
    },
)
async def events(
    request: Request,
    id: JobId,
    last_event_id: Annotated[
        str | None, Header(description="The last event that a client saw before it was cut off")
    ] = None,
) -> Response:
    """Follow a job until it ends. A client that comes back with `Last-Event-ID` goes on where it was."""
    look = partial(anyio.to_thread.run_sync, stored_job, request, id, limiter=request.app.state.listening)
    job: Job = await look()
    if job.state in ENDED and last_event_id == _id(job):
        return Response(status_code=204)  # tells a browser not to come back
    client, listeners = client_of(request.scope, request.app.state.tokens), request.app.state.listeners
    settings: Settings = request.app.state.settings
    for count, most, whose in (
        (listeners.total(), settings.max_listeners, ""),
        (listeners[client], settings.max_listeners_per_client, " of yours"),
    ):
        if count >= most:
            raise TooManyListeners(
                f"{count} streams of events{whose} are open already.", advice="Ask GET /v1/jobs/{id} now and then."
            )

    async def stream() -> AsyncIterator[bytes]:
        if HEAD in request.scope:
            return  # nobody listens
        listeners[client] += 1
        try:
            yield f"retry: {_RETRY}\n\n".encode()
            async for text in _follow(job, look, last_event_id):
                yield text.encode()
        finally:
            listeners[client] -= 1
            if not listeners[client]:
                del listeners[client]

    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(stream(), headers=headers, media_type="text/event-stream")


async def _follow(job: Job, look: Any, seen: str | None) -> AsyncIterator[str]:
    """Yield events while the job changes, and comments while it does not."""
    begun = spoken = time.monotonic()
    state = None if seen != _id(job) else job.state
    while True:
        if seen != _id(job):
            kind = "progress" if job.state == state else "state"
            seen, state, spoken = _id(job), job.state, time.monotonic()
            yield f"id: {seen}\nevent: {kind}\ndata: {view(job, whole=False).model_dump_json()}\n\n"
        elif time.monotonic() - spoken >= _HEARTBEAT:
            spoken = time.monotonic()
            yield ": still here\n\n"
        if job.state in ENDED or time.monotonic() - begun >= _LONGEST:
            return
        await anyio.sleep(_LOOK)
        job = await look()


def _id(job: Job) -> str:
    """Return what changes whenever something about a job does that is worth an event; heartbeats are not."""
    return f"{job.state}-{job.attempts}-{job.progress:.4f}"
