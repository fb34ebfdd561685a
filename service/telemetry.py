"""What an operator sees: one log record per request with its id, and counts and latencies for Prometheus.

The records go to the logger `wizen.service`; besides the sentence they carry `request_id`, `method`, `path`, `route`,
`status`, `milliseconds` and `bytes` as attributes, so that a JSON formatter needs no parsing.
"""

from __future__ import annotations

import logging
import time
from typing import Any

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from store.errors import StoreError

from . import problems

__all__ = ["HEAD", "LOGGER", "Metrics", "Telemetry", "record"]

LOGGER = logging.getLogger("wizen.service")

#: Says of a scope whose method is GET that its body is sent to nobody.
HEAD = "wizen.head"

_BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 5.0)


class Metrics:
    """Counts and latencies per route; one registry per app, so that two apps in a process do not mix."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "wizen_requests_total", "Answered requests", ["route", "method", "status"], registry=self.registry
        )
        self.seconds = Histogram(
            "wizen_request_seconds", "Time to answer", ["route"], buckets=_BUCKETS, registry=self.registry
        )

        self._of: dict[tuple[str, str, int], tuple[Any, Any]] = {}
        self.jobs = Gauge("wizen_jobs", "Jobs in the store's ledger", ["state"], registry=self.registry)

    def count(self, route: str, method: str, status: int, seconds: float) -> None:
        """Count an answer."""
        # finding what belongs to some labels takes as long as the rest
        found = self._of.get((route, method, status))
        if found is None:
            found = self.requests.labels(route, method, str(status)), self.seconds.labels(route)
            self._of[route, method, status] = found
        found[0].inc()
        found[1].observe(seconds)

    def page(self, request: Request) -> Response:
        """Return the numbers in Prometheus' text format; jobs are counted when they are asked for."""
        try:
            ledger = request.app.state.tables.store.ledger
            for state, count in ledger.counts().items() if ledger.path.is_file() else ():
                self.jobs.labels(state).set(count)
        except StoreError:
            self.jobs.clear()  # no store, or a ledger that cannot be read: /healthz says so
        return Response(generate_latest(self.registry), media_type=CONTENT_TYPE_LATEST)


class Telemetry:
    """The outermost layer: names every request, logs it, and turns what nobody foresaw into a problem."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; HEAD goes on as GET and loses its body on the way back."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        begin = time.perf_counter()
        request_id = problems.identify(scope)
        scope.setdefault("state", {})["request_id"] = request_id
        method = scope["method"]
        status, sent = 0, 0

        async def watched(message: Message) -> None:
            nonlocal status, sent
            if message["type"] == "http.response.start":
                status = message["status"]
                others = [pair for pair in message.get("headers", ()) if pair[0] != b"x-request-id"]
                message = {**message, "headers": [*others, (b"x-request-id", request_id.encode("latin-1"))]}
            elif message["type"] == "http.response.body":
                if method == "HEAD":
                    message = {**message, "body": b""}
                sent += len(message.get("body", b""))
            await send(message)

        if method == "HEAD":
            # the server's own still says that no body is to be sent
            scope = {**scope, "method": "GET", HEAD: True}
        try:
            await self.app(scope, receive, watched)
        except Exception:
            LOGGER.exception("request %s failed", request_id, extra={"request_id": request_id})
            if status:
                raise  # half an answer is out: the connection must break
            await problems.unforeseen(scope)(scope, receive, watched)
        finally:
            record(self.metrics, scope, method, status, sent, time.perf_counter() - begin)


def record(metrics: Metrics, scope: Scope, method: str, status: int, sent: int, seconds: float) -> None:
    """Count an answer of so many bytes and log it."""
    # the route, not the path: what a stranger types must not become a label
    route = getattr(scope.get("route"), "path", "none")
    known = method if method in {"GET", "HEAD", "POST", "PUT", "DELETE", "PATCH", "OPTIONS"} else "other"
    metrics.count(route, known, status, seconds)
    if not LOGGER.isEnabledFor(logging.INFO):
        return
    fields = {
        "request_id": scope["state"]["request_id"],
        "method": method,
        "path": scope["path"],
        "route": route,
        "status": status,
        "milliseconds": round(1e3 * seconds, 3),
        "bytes": sent,
    }
    LOGGER.info(
        "%s %r %d %.1f ms %d bytes id=%s",
        method, scope["path"], status, 1e3 * seconds, sent, fields["request_id"],
        extra=fields,
    )  # fmt: skip
