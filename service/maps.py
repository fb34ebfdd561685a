"""`GET /v1/maps`: what the tables of shapes cover, by axis and stage, with a picture of each."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import Any

from fastapi import APIRouter, Path, Request
from starlette.responses import Response

from solver.contract import Solver
from store.errors import CorruptTable, UnknownTable
from store.families.choose import Families
from store.lookup import ShapeTable
from store.store import Store
from store.tables import TableInfo
from sweeps import families as covering

from . import portraits, problems, vocabulary
from .settings import Settings
from .shapes.live import LiveTables
from .views.addresses import link
from .views.tags import matches

__all__ = ["listed", "router"]

#: Other pictures of the same tables have other addresses and tags: browsers keep them for a day.
_DRAWN = "-2"
_DAY = 86400
_LISTING = threading.Lock()
router = APIRouter(tags=["catalogue"])

_PNG, _TOML = problems.files(["image/png"]), problems.files(["application/toml"])


@router.get("/v1/maps", summary="What is covered", responses=problems.responses(503))
def maps(request: Request) -> dict[str, Any]:
    """List the families of shapes that can be asked for: axes with the values that were run, stages with how many runs
    converged and how far they are off, quality, version, how they were made, the presets that they hold.
    """
    return {"maps": listed(request.app.state.tables)}


def listed(live: LiveTables) -> list[dict[str, Any]]:
    """Return what each table covers as JSON values, with links; a damaged one has a `complaint` instead.

    Raises:
        MissingStore: there is no store.

    """
    # what begins aside and who asks meanwhile would read the same families twice
    with _LISTING:
        return [_said(live, name) for name in live.names()]


def _said(live: LiveTables, name: str) -> dict[str, Any]:
    """Return what one table covers, or its `complaint`."""
    try:
        info, solver, families = _known(live, name)
        said = covering.covered(live.store, families, info, solver)
    except (CorruptTable, FileNotFoundError) as error:
        return {"name": name, "complaint": str(error)}
    point, stage = covering.portrait(live.store, families, info)
    links: dict[str, str] = {
        "self": link(f"/v1/tables/{name}"),
        "shapes": link(f"/v1/shapes/{info.solver}?table={name}"),
        "thumbnail": link(f"/v1/maps/{name}/thumbnail.png?v={info.digest[:12]}{_DRAWN}"),
    }
    if info.plan:
        links["plan"] = link(f"/v1/maps/{name}/plan.toml")
    return {**said, "portrait": {**point, solver.stages.symbol: stage}, "links": links}


@router.get(
    "/v1/maps/{name}/thumbnail.png",
    summary="A picture of a family",
    response_class=Response,
    responses={200: {"content": _PNG}, 304: {"description": "It has not changed"}, **problems.responses(404, 503)},
)
def thumbnail(request: Request, name: str = Path(description="Name of a table; GET /v1/maps lists them")) -> Response:
    """Draw a family's preset, or its middle sample, dried up."""
    live: LiveTables = request.app.state.tables
    settings: Settings = request.app.state.settings
    info, _, families = _known(live, name)
    # while a new generation is opened, the picture is still of the old one
    table = live.get(name) if live.is_open(name) else None
    digest = info.digest if table is None else table.digest
    if matches(request.headers.get("if-none-match", ""), _tag(digest)):
        return Response(status_code=304, headers=_headers(settings, digest, info.digest))
    found = portraits.of_table(digest)
    if found is None:
        table = table or live.get(name)
        digest, found = table.digest, _drawn(table, families, live.store)
    return Response(found, headers=_headers(settings, digest, info.digest), media_type="image/png")


def _headers(settings: Settings, digest: str, newest: str) -> dict[str, str]:
    """Return the headers of a picture of one generation: its address names the newest, and is kept for that alone."""
    return {"ETag": _tag(digest), "Cache-Control": settings.kept(_DAY) if digest == newest else "no-cache"}


def _tag(digest: str) -> str:
    return f'"{digest[:32]}-thumbnail{_DRAWN}"'


@router.get(
    "/v1/maps/{name}/plan.toml",
    summary="The plan behind a family",
    response_class=Response,
    responses={200: {"content": _TOML}, **problems.responses(404, 503)},
)
def plan(request: Request, name: str = Path(description="Name of a table; GET /v1/maps lists them")) -> Response:
    """Return the plan of the sweep that a table was made from: `wizen sweep` makes the rest of it."""
    info: TableInfo = request.app.state.tables.info(name)
    if not info.plan:
        raise UnknownTable(f"nobody kept the plan of table {name!r}.", "GET /v1/maps says which have one.")
    return Response(info.plan, media_type="application/toml")


def _known(live: LiveTables, name: str) -> tuple[TableInfo, Solver, Families]:
    info = live.info(name)
    solver = vocabulary.solver_named(info.solver)
    return info, solver, live.families(solver)


@lru_cache(maxsize=64)
def _drawn(table: ShapeTable, families: Families, store: Store) -> bytes:
    return covering.drawn(table, families, store)
