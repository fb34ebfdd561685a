"""`POST /v1/scenes`: a scene as one file, or as numbers alone."""

from __future__ import annotations

import difflib
import hashlib
import re
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any

import orjson
from fastapi import APIRouter, Body, Query, Request
from starlette.responses import Response

from store.ledger.jobs import Job

from .. import problems
from ..errors import Forbidden, InvalidQuery, Unauthorized, Wrong
from ..jobs.submit import asker_of, submit
from ..limits import memory
from ..security import authorize, bearer
from ..settings import Settings
from ..shapes.live import LiveTables
from ..views.scene import ScenePage
from .request import FORMATS, Scene, parse

if TYPE_CHECKING:
    from .compose import Made
    from .kinds import Asked, Runs

__all__ = ["router"]

router = APIRouter(tags=["scenes"])


def _inlined(schema: Any, known: dict[str, Any]) -> Any:
    """Return a schema with what it refers to in place: the page has no definitions beside its own."""
    if isinstance(schema, list):
        return [_inlined(one, known) for one in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        rest = {name: value for name, value in schema.items() if name != "$ref"}
        return {**_inlined(known[schema["$ref"].rpartition("/")[2]], known), **rest}
    return {name: _inlined(value, known) for name, value in schema.items() if name != "$defs"}


@lru_cache(maxsize=1)
def _maker() -> Callable[..., Made]:
    """Return what makes scenes: it takes a while to import, and the service starts without."""
    from .compose import make

    memory.keep("scenes")
    return make


def _runs(request: Request) -> Runs:
    """Return where runs are looked for, and what asks for those that are missing: jobs, of who may have any."""
    from .kinds import Runs

    state, secret = request.app.state, bearer(request)

    def ask(asked: Asked) -> tuple[Job | None, str]:
        try:
            token = authorize(state, secret, "run")
        except (Unauthorized, Forbidden) as error:
            return None, f"With a token of the scope run the scene asks for it as a job. {error.advice}"
        found = submit(
            state,
            asked.solver,
            asked.parameters,
            asked.need,
            asker_of(request, token),
            preset=asked.preset,
            unlimited=token.allows("admin"),
        )
        return found.job, ""

    return Runs(lambda: state.tables.store, ask)


#: The tag of a mesh, as its extras say it, in quotes; that of a whole answer is longer.
_MESH = re.compile('"[0-9a-f]{16}"')
_SCHEMA = Scene.model_json_schema()
_BODY = _inlined(_SCHEMA, _SCHEMA.get("$defs", {}))
_TYPES = [media_type for name, (media_type, _) in FORMATS.items() if name != "json"]
_REPORT = {"schema": {"$ref": "#/components/schemas/ScenePage"}}


@router.post(
    "/v1/scenes",
    summary="Many shapes as one scene",
    response_class=Response,
    responses={
        200: {
            "model": ScenePage,
            "description": "The scene, or its report",
            "content": {**problems.files(_TYPES), FORMATS["json"][0]: _REPORT},
        },
        **problems.responses(400, 404, 406, 413, 422, 500, 501, 503),
    },
    openapi_extra={"requestBody": {"content": {"application/json": {"schema": _BODY}}}},
)
def scenes(
    request: Request,
    body: Annotated[Any, Body()],
    format: Annotated[str, Query(description="glb, usdc, usda or json")] = "glb",
    compress: Annotated[bool, Query(description="glb: with EXT_meshopt_compression")] = True,
) -> Response:
    """Answer with one file in which each distinct shape is there once, at the detail that the camera can see.

    What is out of the picture, behind others or smaller than a pixel is left out, and kinds of which nothing is in
    sight are not computed. `format=json` is the report alone, without a file; a file brings the report's summary in
    the header `Wizen-Scene`. Items may be stages of stored runs; those that are not stored become jobs where the
    request has a token with the scope run, and something plain stands in for them meanwhile. `If-None-Match` may name
    meshes by their etags: these are not sent again; or the whole answer by its own: 304.
    """
    make = _maker()
    settings: Settings = request.app.state.settings
    tables: LiveTables = request.app.state.tables
    if format not in FORMATS:
        near = difflib.get_close_matches(format, list(FORMATS), n=1)
        hint = f"Did you mean {near[0]!r}? " if near else ""
        advice = f"{hint}Formats: {', '.join(FORMATS)}."
        raise InvalidQuery.of([Wrong("format", f"there is no format {format[:40]!r}", advice)])
    given = [tag.strip().removeprefix("W/") for tag in request.headers.get("if-none-match", "").split(",")]
    scene = parse(body)
    held = tuple(tag[1:-1] for tag in given if _MESH.fullmatch(tag))
    if held:
        scene = scene.model_copy(update={"known": scene.known + held})
    made = make(scene, tables, settings.max_resolution, format, compress, _runs(request))
    if format == "json":
        return Response(orjson.dumps(made.report), media_type=FORMATS["json"][0])
    told = {name: value for name, value in made.report.items() if name not in ("items", "places", "generator")}
    etag = f'"{hashlib.sha256(made.data).hexdigest()[:32]}"'
    headers = {"Wizen-Scene": orjson.dumps(told).decode(), "ETag": etag}
    if etag in given:
        return Response(status_code=304, headers=headers)
    return Response(made.data, media_type=FORMATS[format][0], headers=headers)
