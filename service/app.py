"""The application: settings, tables and routes put together. `uvicorn service.app:app` serves it."""

from __future__ import annotations

from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import anyio
import anyio.to_thread
from fastapi import Depends, FastAPI
from starlette.middleware.cors import CORSMiddleware
from starlette.routing import Route

from solver import __version__
from store.tokens import Tokens

from . import catalogue, hours, maps, page, problems, results
from .coding import Coding
from .declared import refuse_others
from .jobs import events as jobs_events
from .jobs import fields as jobs_fields
from .jobs import meshes as jobs_meshes
from .jobs import results as jobs_results
from .jobs import routes as jobs
from .jobs.runner import JobRunner
from .limits import memory
from .limits.admission import Admission, Load
from .limits.door import DOOR, Door
from .limits.requests import Limits
from .matching import routes as matching
from .openapi import Documented, operation_id
from .scenes import routes as scenes
from .security import requires
from .sessions import routes as sessions
from .sessions.keeping import Sessions
from .settings import Settings
from .shapes import batch
from .shapes import routes as shapes
from .shapes.answers import Answers, Repeats
from .shapes.compiling import Compiling
from .shapes.live import LiveTables
from .shapes.shortcut import Shortcut
from .shapes.turns import Turns
from .shapes.warming import warm
from .stopping import at_signals
from .telemetry import Metrics, Telemetry, record
from .views.addresses import Rooted

__all__ = ["create_app"]

if TYPE_CHECKING:
    app: FastAPI


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[dict[str, Door]]:
    # handlers run in this pool; each shape in flight holds its arrays, so their number bounds the memory
    anyio.to_thread.current_default_thread_limiter().total_tokens = app.state.settings.threads
    runner = JobRunner(app.state.settings)
    with at_signals(runner.halt):
        if runner.wanted:
            runner.start()
        try:
            memory.keep("service")
            if app.state.is_warmed:
                warm(app.state.tables, maps.listed)
            yield {DOOR: app.state.door}
        finally:
            await app.state.sessions.close_all()
            if runner.wanted:
                await anyio.to_thread.run_sync(runner.stop)


def create_app(settings: Settings | None = None, is_warmed: bool = False) -> FastAPI:
    """Return the service over one store; without settings, those of the environment.

    The store and its tables are opened by the first request that needs them, so the service may start before they
    exist and says what is missing until they do. One that `is_warmed` opens the first of them on its own, once it
    listens.
    """
    memory.settle()
    settings = settings or Settings()
    app = Documented(
        title="wizen",
        version=__version__,
        summary="Physically based shapes that can be asked for",
        lifespan=_lifespan,
        docs_url=None,  # both of FastAPI's load scripts from elsewhere; `page` serves our own copy
        redoc_url=None,
        generate_unique_id_function=operation_id,
    )
    app.state.settings, app.state.is_warmed = settings, is_warmed
    app.state.compiling = Compiling()
    app.state.tables = LiveTables(settings.store, settings.reload_interval, app.state.compiling)
    app.state.answers = Answers(settings.cache_bytes)
    app.state.turns = Turns(app.state.settings.max_waiting)
    app.state.tokens = Tokens(settings.store)
    # looking at jobs has threads of its own, so that listeners do not wait for shapes, nor shapes for them
    app.state.listeners, app.state.listening = Counter[str](), anyio.CapacityLimiter(2)
    app.state.sessions = Sessions(settings)
    metrics = Metrics()
    problems.install(app)
    # who may not read is told that first
    guards = [*([] if settings.public_read else [Depends(requires("read"))]), Depends(refuse_others)]
    # a query may be too long wherever it goes
    declared = problems.responses(414, 422, *(() if settings.public_read else (401, 403)))
    guarded = (
        catalogue.router,
        shapes.router,
        batch.router,
        scenes.router,
        matching.router,
        jobs.reading,
        jobs_events.router,
        jobs_fields.router,
        jobs_results.router,
        results.router,
        maps.router,
        hours.router,
    )
    app.include_router(catalogue.open_router, responses=problems.responses(414))
    for router in guarded:
        app.include_router(router, dependencies=guards, responses=declared)
    app.include_router(sessions.router)
    for router in (jobs.writing, jobs_meshes.router):
        app.include_router(router, responses=problems.responses(414))
    routers = (*guarded, catalogue.open_router, jobs.writing, jobs_meshes.router)
    app.state.routes = [route for router in routers for route in router.routes if isinstance(route, Route)]
    page.install(app, settings.page)
    if settings.metrics:
        app.add_api_route("/metrics", metrics.page, include_in_schema=False)
    _surround(app, settings, metrics)
    return app


def _surround(app: FastAPI, settings: Settings, metrics: Metrics) -> None:
    """Put around the routes what a request passes on its way to them; the last one added is the outermost."""
    load = Load(settings.threads, min(settings.max_delay, settings.timeout))
    is_kept = partial(app.state.answers.is_kept, app.state)
    app.state.door = Door(settings, load, app.state.tokens, is_kept, partial(record, metrics))
    if settings.public_read:
        app.add_middleware(Shortcut, state=app.state)
    app.add_middleware(Admission, load=load, tokens=app.state.tokens)
    app.add_middleware(Limits, settings=settings, is_patient=lambda: app.state.compiling.is_under_way)
    if settings.public_read and settings.cache_bytes:
        app.add_middleware(Repeats, state=app.state)
    if settings.compress != "off":
        app.add_middleware(Coding, settings=settings)
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "If-None-Match"],
            expose_headers=[
                *("ETag", "Location", "Retry-After", "Server-Timing", "X-Request-ID"),
                *("Content-Disposition", "Wizen-Scene", "Wizen-Tier"),
            ],
        )
    app.add_middleware(Telemetry, metrics=metrics)
    if settings.root_path:
        app.add_middleware(Rooted, root=settings.root_path)


def __getattr__(name: str) -> Any:
    # made when first asked for: importing this module must not read the environment
    if name == "app":
        globals()["app"] = made = create_app(is_warmed=True)
        return made
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
