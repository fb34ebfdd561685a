"""`POST /v1/match`: from a mesh, a mask or descriptors back to the parameters and the stage that come nearest."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

import anyio.to_thread
from anyio.lowlevel import RunVar
from fastapi import APIRouter, Query, Request

from .. import problems
from ..errors import InvalidQuery, Overloaded, TimedOut, Wrong
from ..formats import sent
from ..limits import waited
from ..settings import Settings
from ..shapes.live import LiveTables
from ..views.addresses import link
from ..views.match import MatchPage

__all__ = ["router"]

router = APIRouter(tags=["match"])

_FILES = sent.contents([*(types[0] for types in sent.MESHES.values()), "image/png"])
_NUMBERS: dict[str, Any] = {
    "schema": {
        "type": "object",
        "description": "Descriptors by name: a number, or a number and its scatter",
        "minProperties": 1,
        "additionalProperties": {
            "anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 1, "maxItems": 2}]
        },
    },
    "examples": {"some": {"value": {"roughness": 0.04, "volume": [0.62, 0.01]}}},
}
#: A search uses all that one core gives for seconds, and what is read for it may be large: one at a time, whose turn it
#: is, and the next waits so long [s]. None who waits takes a thread from what is quickly answered.
_TURN, _WAIT = RunVar[anyio.Lock]("wizen.match"), 10.0
#: Share of the service's time-out after which a search is given up.
_PATIENCE = 0.9


@router.post(
    "/v1/match",
    summary="The shape that comes nearest",
    responses=problems.responses(400, 404, 406, 413, 422, 500, 501, 503),
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {**_FILES, "application/json": _NUMBERS},
        }
    },
)
async def match(
    request: Request,
    size: Annotated[
        float | None,
        Query(gt=0, allow_inf_nan=False, description="Length of r1 in the target's unit (pixels of a mask); none: any"),
    ] = None,
    table: Annotated[str | None, Query(description="The table to search; none: all")] = None,
    known: Annotated[
        str,
        Query(
            pattern=r"^([A-Za-z0-9_]+:-?[0-9.eE+-]+(,[A-Za-z0-9_]+:-?[0-9.eE+-]+)*)?$",
            max_length=2000,
            description="What is known of it, as name:number with commas between",
            examples=["te:0.035"],
        ),
    ] = "",
) -> MatchPage:
    """Answer with the parameters and the stage whose shape comes nearest to a mesh, a mask or descriptors.

    Not the same wrinkles: the same outline, roughness, spectrum and slopes. The answer says how near it comes, how sure
    each number is, and what else is as near. Of a mesh without `size` the form alone counts.
    """
    body = await request.body()
    media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    settings: Settings = request.app.state.settings
    progress = _until(_PATIENCE * settings.timeout)
    work = partial(_matched, body, media, size, table, _known(known), request.app.state.tables, progress)
    # whoever leaves does not take the turn with him: it ends when the thread does
    page = await asyncio.shield(_alone(work, min(_WAIT, 0.5 * settings.timeout)))
    for one in (page.best, *page.alternatives):
        one.link = link(one.link)
    return page


def _known(text: str) -> dict[str, float]:
    """Return the numbers that are known.

    Raises:
        InvalidQuery: one is named twice, or is no number.

    """
    found: dict[str, float] = {}
    for pair in filter(None, text.split(",")):
        name, _, value = pair.partition(":")
        try:
            number = float(value)
        except ValueError:
            raise InvalidQuery.of([Wrong("known", f"{value[:40]!r} is no number", "Write known=te:0.035.")]) from None
        if name in found:
            raise InvalidQuery.of([Wrong("known", f"{name[:40]} is given twice", "Give it once.")])
        found[name] = number
    return found


async def _alone(work: Callable[[], MatchPage], patience: float) -> MatchPage:
    """Return what work gives, in a thread of its own, once no other does any.

    Raises:
        Overloaded: another one was not done in time.

    """
    turn = _TURN.get(None) or anyio.Lock()
    _TURN.set(turn)
    try:
        with anyio.fail_after(patience):
            await turn.acquire()
    except TimeoutError:
        raise Overloaded("another search is under way.", advice="Ask again in some seconds.") from None
    try:
        return await anyio.to_thread.run_sync(work, limiter=anyio.CapacityLimiter(1))
    finally:
        turn.release()


def _until(patience: float) -> Callable[[float, str], None]:
    """Return what gives a search up so many seconds from now [s], or when nobody waits for it any more."""
    end = time.monotonic() + patience

    def progress(share: float, what: str) -> None:
        advice = "Ask again: what was looked at is kept. Or name a table, or say what is known."
        waited.check(advice)
        if time.monotonic() > end:
            raise TimedOut(f"the search took more than {patience:.0f} s.", advice=advice)

    return progress


def _matched(
    body: bytes,
    media: str,
    size: float | None,
    table: str | None,
    known: Mapping[str, float],
    tables: LiveTables,
    progress: Callable[[float, str], None],
) -> MatchPage:
    # what reads and searches takes a while to import; the service starts without
    from . import answer, targets

    progress(0.0, "reading")
    target = targets.read(body, sent.suffix_of(media, body, targets.KINDS, "target"), size)
    return answer.match(target, tables, table, known, progress)
