"""`/v1/sessions/{solver}`: a WebSocket onto a live engine (docs/sessions.md)."""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any, get_args

import orjson
from fastapi import APIRouter
from fastapi.security.utils import get_authorization_scheme_param
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from solver import registry
from solver.contract import InvalidInput, Need, Quality, SolverError
from store.errors import StoreError
from store.ledger.asks import Asker
from store.tokens import Token

from .. import problems
from ..errors import InvalidQuery, ServiceError, TimedOut, TooCostly, UnknownSolver
from ..limits.clients import address
from ..security import authorize
from ..settings import Settings
from .keeping import Sessions
from .session import CLOSED, Session

__all__ = ["router"]

router = APIRouter()

#: Seconds within which a connection has to say what it wants.
_OPENING = 10.0
_NEW = frozenset({"do", "id", "token", "params", "preset", "quality", "fields"})
_AGAIN = frozenset({"do", "id", "token", "session", "key"})


@router.websocket("/v1/sessions/{solver}")
async def live(client: WebSocket, solver: str) -> None:
    """Open a session, or take one up again, and pass messages on until either side has enough."""
    await client.accept()
    sessions: Sessions = client.app.state.sessions
    session: Session | None = None
    try:
        session = await _opened(client, solver, sessions)
        while True:
            message = await _message(client)
            if message.get("do") == "close":
                await sessions.close(session)
                await client.close(1000)
                return
            await session.take(message)
    except (SolverError, StoreError, ServiceError) as error:
        await _refuse(client, error)
    except (WebSocketDisconnect, RuntimeError):
        pass  # gone without a word, or sent away meanwhile
    finally:
        if session is not None:
            await session.detach(client)


async def _opened(client: WebSocket, solver: str, sessions: Sessions) -> Session:
    """Take the first message and return the session that it asks for, attached."""
    try:
        async with asyncio.timeout(_OPENING):
            first = await _message(client)
    except TimeoutError:
        raise TimedOut(f"nothing came within {_OPENING:g} s.", advice='Send {"do": "open", ...} first.') from None
    if first.get("do") != "open":
        raise InvalidInput("the first message opens a session.", advice='Send {"do": "open", "token": ...}.')
    known = _AGAIN if "session" in first else _NEW
    strange = [name for name in first if name not in known]
    if strange:
        raise InvalidInput(f"open does not take {strange[0]!r}.", advice=f"It takes {', '.join(sorted(known))}.")
    state, settings = client.app.state, client.app.state.settings
    token = authorize(state, _secret(client, first), "run")
    if "session" in first:
        session = sessions.find(first["session"], first.get("key"), solver, token)
    else:
        asked = _checked(solver, first, settings, token)
        asker = Asker(token.id, token.name, address(client.client.host) if client.client else "")
        session = await sessions.open(asker, token.allows("admin"), asked)
    limits = {"idle": settings.session_idle, "kept": settings.session_kept, "seconds": settings.session_seconds}
    await session.attach(client, limits)
    return session


def _checked(name: str, first: dict[str, Any], settings: Settings, token: Token) -> dict[str, Any]:
    """Return what an engine is to begin with, once the solver's own model has taken it.

    Raises:
        UnknownSolver, InvalidInput: as it says.
        TooCostly: it would need more memory than one job may.

    """
    if name not in registry.names():
        raise UnknownSolver(f"there is no solver {name[:40]!r}.", advice=f"Known: {', '.join(registry.names())}.")
    solver = registry.get(name)
    if solver.live is None:
        offering = [other for other in registry.names() if registry.get(other).live is not None]
        raise InvalidInput(f"{name} offers no live engine.", advice=f"These do: {', '.join(offering)}.")
    quality, fields = first.get("quality", "preview"), first.get("fields") or []
    if quality not in get_args(Quality):
        raise InvalidInput(f"there is no quality {quality!r}.", advice=f"Known: {', '.join(get_args(Quality))}.")
    unknown = [field for field in fields if field not in solver.live.fields] if isinstance(fields, list) else [fields]
    if unknown:
        raise InvalidInput(
            f"fields: {unknown[0]!r} cannot be shown.", advice=f"Known: {', '.join(solver.live.fields)}."
        )
    preset = first.get("preset")
    if preset is not None and not isinstance(preset, str):
        raise InvalidInput("preset: a name is wanted.", advice=f"Known: {', '.join(solver.presets)}.")
    params = solver.parse(first.get("params") or {}, preset)
    memory = solver.cost(params, solver.settle(Need(quality=quality), preset)).bytes
    if memory > settings.max_job_bytes and not token.allows("admin"):
        raise TooCostly(
            f"this engine would need about {memory / 1e9:.3g} GB, more than {settings.max_job_bytes / 1e9:.3g} GB.",
            advice="Lower the quality.",
        )
    whole = params.model_dump(mode="json")
    return {"solver": name, "params": whole, "preset": None, "quality": quality, "fields": fields}


def _secret(client: WebSocket, first: dict[str, Any]) -> str | None:
    scheme, secret = get_authorization_scheme_param(client.headers.get("authorization"))
    given = first.get("token")
    return given if isinstance(given, str) else secret if scheme.lower() == "bearer" else None


async def _message(client: WebSocket) -> dict[str, Any]:
    """Return the next message.

    Raises:
        InvalidQuery: it is no JSON object.
        WebSocketDisconnect: the client has gone.

    """
    came = await client.receive()
    if came["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(came.get("code", 1005))
    text = came.get("text")
    # numbers that are none would pass through to the engine
    with contextlib.suppress(ValueError, TypeError, RecursionError):
        found = json.loads(text, parse_constant=_none) if text is not None else None
        if isinstance(found, dict):
            # half a character, integers of more than 64 bits, depths beyond 254: no engine is told of them
            orjson.dumps(found)
            return found
    raise InvalidQuery(
        "a message is one JSON object, as text, with whole numbers of 64 bits at most.",
        advice="docs/sessions.md lists them.",
    )


def _none(constant: str) -> Any:
    raise ValueError(constant)


async def _refuse(client: WebSocket, error: Exception) -> None:
    """Say what is wrong, and close."""
    told = problems.told(error)
    if client.application_state is not WebSocketState.CONNECTED:
        return
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        async with asyncio.timeout(_OPENING):
            await client.send_json({"say": "error", "id": None, "problem": told})
            await client.close(CLOSED + told["status"], told["detail"][:100])
