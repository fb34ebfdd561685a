"""The web page: `/` for browsers, `/docs` for the API, `/assets` for what both load. Everything comes from here.

`make page` builds it from `service/viewer` (TypeScript, three.js, Swagger UI). Without a build, the same addresses say
what to run. The build is looked for at every request, so that it may come after the service.
"""

from __future__ import annotations

import hashlib
import html
from pathlib import Path

import mimeparse
from fastapi import FastAPI, Request
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

__all__ = ["BUILT", "answer", "install", "wanted"]

#: Where `make page` puts the built page.
BUILT = Path(__file__).parent / "viewer" / "dist"

_COMMON = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
#: Scripts that write HTML from text would have to name a policy, and there is none.
_TRUSTED = "; require-trusted-types-for 'script'; trusted-types 'none'"
#: Swagger UI writes style attributes and draws its icons from data URLs.
_DOCS_POLICY = _POLICY.replace("style-src 'self'", "style-src 'self' 'unsafe-inline'").replace(
    "img-src 'self'", "img-src 'self' data:"
)

_PLAIN = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>wizen</title>
<h1>wizen</h1>
<p>The service runs, but its page is not built. In the checkout, run</p>
<pre>make page</pre>
<p>and reload. It needs a package registry and takes less than a minute; {root} is where it puts the page.</p>
<p>The API answers without it: <a href="openapi.json">its description</a>, <a href="v1/tables">tables</a>,
<a href="v1/solvers">solvers</a>, <a href="healthz">health</a>.</p>
"""


def wanted(accept: str | None) -> bool:
    """Return whether an Accept header prefers a page to JSON, as those of browsers do."""
    try:
        return bool(mimeparse.best_match(["text/html", "application/json"], (accept or "*/*").lower()) == "text/html")
    except mimeparse.MimeTypeParseException:
        return False


def answer(request: Request) -> Response:
    """Return the viewer, or what to run to have it."""
    return _file(request, "index.html", _POLICY + _TRUSTED)


def install(app: FastAPI, root: Path) -> None:
    """Serve the page that is, or will be, built at `root`."""
    app.state.page = root
    app.add_api_route("/docs", _docs, include_in_schema=False)
    app.mount("/assets", GZipMiddleware(_Assets(directory=root / "assets", check_dir=False), minimum_size=1024))


def _docs(request: Request) -> Response:
    return _file(request, "docs.html", _DOCS_POLICY)


def _file(request: Request, name: str, policy: str) -> Response:
    """Return a page that is asked for again each time: it names the assets of one build."""
    root: Path = request.app.state.page
    try:
        body = (root / name).read_bytes()
    except OSError:
        body = _PLAIN.format(root=html.escape(str(root))).encode()
    headers = {
        **_COMMON,
        "Content-Security-Policy": policy,
        "Cache-Control": "no-cache",
        "ETag": f'"{hashlib.sha256(body).hexdigest()[:32]}"',
        "Vary": "Accept",
    }
    held = request.headers.get("if-none-match", "")
    if headers["ETag"] in held or held.strip() == "*":
        return Response(status_code=304, headers=headers)
    return Response(body, headers=headers, media_type="text/html")


class _Assets(StaticFiles):
    """Files whose names carry their digest: whoever has one never needs to ask again."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers.update({**_COMMON, "Cache-Control": "public, max-age=31536000, immutable"})
        return response
