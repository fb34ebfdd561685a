"""RFC 9457 problems: one table gives every exception its HTTP status, and every error one JSON shape.

The type of a problem is `urn:wizen:problem:<code>`; clients branch on it and people read `detail` and `advice`.
"""

from __future__ import annotations

import difflib
import json
import os
import re
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

import orjson
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import Scope

from solver import contract
from store import errors as stored

from .. import errors
from . import findings

__all__ = [
    "MEDIA_TYPE",
    "STATUS",
    "URN",
    "Culprit",
    "Problem",
    "files",
    "identify",
    "install",
    "of",
    "responses",
    "status_of",
    "told",
    "unforeseen",
]

#: Ids from outside are kept only if they cannot break a log line.
_HONEST_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")

MEDIA_TYPE = "application/problem+json"
URN = "urn:wizen:problem:"

#: Exception class -> status; a class that is not listed has its nearest ancestor's.
STATUS: Mapping[type[Exception], int] = {
    contract.SolverError: 500,
    contract.InvalidInput: 422,
    contract.NotConverged: 422,
    contract.Unstable: 422,
    contract.Cancelled: 409,
    stored.StoreError: 500,
    stored.MissingStore: 503,
    stored.CorruptShard: 503,
    stored.CorruptTable: 503,
    stored.CorruptLedger: 503,
    stored.UnknownTable: 404,
    stored.StaleTable: 409,
    stored.EmptyTable: 503,
    stored.OutsideTable: 422,
    stored.TooUncertain: 422,
    stored.MixedSamples: 503,
    stored.StorageFull: 507,
    stored.StorageFailed: 503,
    stored.CorruptBackup: 503,
    stored.UnknownJob: 404,
    stored.QueueFull: 429,
    stored.QuotaSpent: 429,
    stored.ReadOnlyStore: 409,
    stored.NetworkFileSystem: 503,
    stored.CorruptTokens: 503,
    stored.InvalidToken: 422,
    stored.UnknownToken: 404,
    errors.ServiceError: 500,
    errors.InvalidQuery: 422,
    errors.BatchTooLarge: 413,
    errors.NotAcceptable: 406,
    errors.Unavailable: 501,
    errors.UnknownPreset: 404,
    errors.UnknownSolver: 404,
    errors.QueryTooLong: 414,
    errors.BodyTooLarge: 413,
    errors.SlowBody: 408,
    errors.TimedOut: 503,
    errors.Overloaded: 503,
    errors.Unauthorized: 401,
    errors.Forbidden: 403,
    errors.TooCostly: 422,
    errors.NotDone: 409,
    errors.JobFailed: 409,
    errors.JobEnded: 409,
    errors.TooManyListeners: 429,
    errors.TooManySessions: 429,
    errors.UnknownSession: 404,
    errors.EngineDied: 500,
}

#: What to do about what a solver refuses in its model's own words.
_TAKES = "GET /v1/solvers/NAME says what each parameter takes."
#: What is refused before any model sees it.
_UNREADABLE = "Send JSON in UTF-8 that is not nested deeply, with Content-Type: application/json."

#: In the order in which they are named to whoever takes another one.
_METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE")
_RETRY = {429: "10", 503: "5"}


class Culprit(BaseModel):
    """One wrong parameter."""

    name: str = Field(description="The parameter")
    detail: str = Field(description="What is wrong with it")
    advice: str = Field("", description="What to change")


class Nearest(BaseModel):
    """The table that comes nearest to what was asked for."""

    table: str = Field(description="Its name")
    distance: float = Field(description="Over all parameters: logarithms of ratios, or differences")
    parameters: dict[str, dict[str, Any]] = Field(description="What was asked, the nearest in the table, how far")


class Problem(BaseModel):
    """An error as RFC 9457 describes it, with advice."""

    model_config = ConfigDict(json_schema_extra={"description": "An error as RFC 9457 describes it, with advice"})

    type: str = Field(description="What kind of problem this is", examples=[f"{URN}outside-table"])
    title: str = Field(description="The kind in words")
    status: int = Field(description="The HTTP status")
    detail: str = Field(description="What happened this time")
    advice: str = Field("", description="What to change")
    instance: str = Field(description="The request that met the problem")
    request_id: str = Field("", description="Names the request in the service's log")
    errors: list[Culprit] = Field(default_factory=list, description="Every wrong parameter")
    nearest: Nearest | None = Field(None, description="The table that comes nearest")
    links: dict[str, str] = Field(default_factory=dict, description="The run that answers: its address and its command")


def status_of(code: str) -> int:
    """Return the status of a solver's error by its code, which is all that comes from another process; else 500."""
    kinds: list[type[contract.SolverError]] = [contract.SolverError, *contract.SolverError.__subclasses__()]
    for kind in kinds:
        kinds += [below for below in kind.__subclasses__() if below not in kinds]
    found = [STATUS[base] for kind in kinds if kind.code == code for base in kind.__mro__ if base in STATUS]
    return found[0] if found else 500


def told(error: Exception) -> dict[str, Any]:
    """Return what a known exception says of itself where there is no request: to whoever is connected."""
    status = next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)
    code = str(getattr(error, "code", "error"))
    return {
        "type": URN + code,
        "title": code.replace("-", " ").capitalize(),
        "status": status,
        "detail": str(getattr(error, "message", error)),
        "advice": str(getattr(error, "advice", "")),
    }


def of(error: Exception, scope: Scope) -> Response:
    """Return the problem for a known exception: a SolverError, a StoreError or a ServiceError."""
    status = next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)
    advice = str(getattr(error, "advice", ""))
    if not advice and type(error) is contract.InvalidInput:  # a geometry that cannot be says so itself
        advice = _TAKES
    return _response(
        scope,
        status,
        getattr(error, "code", "error"),
        str(getattr(error, "message", error)),
        advice,
        [Culprit(**wrong._asdict()) for wrong in getattr(error, "wrong", ())],
        getattr(error, "headers", None),
        getattr(error, "more", {}),
    )


def unforeseen(scope: Scope) -> Response:
    """Return the problem for an exception that nobody foresaw; what it was stands in the log alone."""
    return _response(
        scope,
        500,
        "internal",
        "the service met an error that it did not foresee.",
        "Report the request id; the log has the rest.",
    )


def responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI entries that declare these statuses as problems."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": HTTPStatus(status).phrase, "content": content} for status in statuses}


def files(media_types: Iterable[str]) -> dict[str, Any]:
    """Return the OpenAPI content of an answer that is a file of one of these types.

    Generators of clients look for a type that they know to be bytes: it comes first, and stands for all of them.
    """
    binary = {"schema": {"type": "string", "format": "binary"}}
    return dict.fromkeys(("application/octet-stream", *media_types), binary)


def install(app: FastAPI) -> None:
    """Make every error of `app` a problem; `app.state.routes` are the addresses that there are."""
    for root in (contract.SolverError, stored.StoreError, errors.ServiceError):
        app.add_exception_handler(root, _known)
    app.add_exception_handler(RequestValidationError, _validation)
    app.add_exception_handler(HTTPException, _http)


def identify(scope: Scope) -> str:
    """Return the id of a request, which its log record and its answer carry: what it came with, if that is honest."""
    given = next((value for name, value in scope["headers"] if name == b"x-request-id"), b"").decode("latin-1")
    return given if _HONEST_ID.fullmatch(given) else os.urandom(16).hex()


async def _known(request: Request, error: Exception) -> Response:
    return of(error, request.scope)


async def _validation(request: Request, error: Exception) -> Response:
    """List every wrong value of a body or path that FastAPI validated."""
    assert isinstance(error, RequestValidationError)
    return of(errors.InvalidQuery.of(findings.wrong(error.errors(), error.body)), request.scope)


async def _http(request: Request, error: Exception) -> Response:
    """Say what there is instead of a path or method that there is not."""
    assert isinstance(error, HTTPException)
    status = error.status_code
    phrase = HTTPStatus(status).phrase
    detail, advice = str(error.detail), ""
    path, headers = request.url.path, dict(error.headers or {})
    if status == 404:
        known = sorted({route.path for route in request.app.state.routes if "{" not in route.path})
        near = difflib.get_close_matches(path, known, n=1)
        detail = f"there is nothing at {path}."
        advice = f"Did you mean {near[0]}? " if near else ""
        advice += "GET / lists what there is."
    elif status == 405:
        allowed = _allowed(request) or headers.get("Allow", "GET")
        detail = f"{path} does not take {request.method}."
        advice = f"Use {allowed}."
        headers["Allow"] = allowed
    elif status == 400:
        advice = _UNREADABLE
    code = phrase.lower().replace(" ", "-").replace("'", "")
    return _response(request.scope, status, code, detail, advice, headers=headers)


def _allowed(request: Request) -> str:
    """Return the methods that an address takes; HEAD goes on as GET (`telemetry`)."""
    found: list[Route] = request.app.state.routes
    taken = {method for one in found if one.path_regex.match(request.scope["path"]) for method in one.methods or ()}
    taken |= {"HEAD"} if "GET" in taken else set()
    return ", ".join(method for method in _METHODS if method in taken)


def _response(
    scope: Scope,
    status: int,
    code: str,
    detail: str,
    advice: str = "",
    wrong: Iterable[Culprit] = (),
    headers: Mapping[str, str] | None = None,
    more: Mapping[str, Any] | None = None,
) -> Response:
    query = scope.get("query_string", b"").decode("latin-1")
    problem = Problem(
        type=URN + code,
        title=code.replace("-", " ").capitalize(),
        status=status,
        detail=detail,
        advice=advice,
        instance=quote(scope["path"], safe="/:@!$'()*+,;=~") + (f"?{query[:512]}" if query else ""),
        request_id=scope.get("state", {}).get("request_id", ""),
        errors=list(wrong),
        **(more or {}),
    )
    body = _encoded(problem.model_dump(exclude_defaults=True))
    extra = {"Cache-Control": "no-store", **(headers or {})}
    if status in _RETRY:
        extra.setdefault("Retry-After", _RETRY[status])
    return Response(body, status, extra, MEDIA_TYPE)


def _encoded(body: dict[str, Any]) -> bytes:
    """Return a problem as JSON. JSON that was sent may hold halves of characters, which no UTF-8 has: those are told as
    they were written.
    """
    try:
        return orjson.dumps(body)
    except TypeError:
        return json.dumps(_whole(body)).encode()


def _whole(value: Any) -> Any:
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode()
    if isinstance(value, Mapping):
        return {_whole(name): _whole(entry) for name, entry in value.items()}
    return [_whole(entry) for entry in value] if isinstance(value, list | tuple) else value
