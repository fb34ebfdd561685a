"""Answers made smaller on the wire, where the client takes that: zstd, br or gzip, whichever it names, in this order.

A compressed answer is another sequence of bytes, so its entity tag is another one (RFC 9110, 8.8.3): the tag of the
plain answer with the coding's name behind it. Who asks again with it is answered like one who has the plain answer.
"""

from __future__ import annotations

import ipaddress
import re
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

from starlette.datastructures import Headers, MutableHeaders

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from .settings import Settings

__all__ = ["Coding"]

#: Bodies below this size gain nothing [bytes].
_LEAST = 1024
#: What the library does not know. Archives, netCDF and USD's binary form are packed already, and points of live views
#: are not worth the wait.
_TYPES = (
    "application/x-mdd",
    "application/x-ndjson",
    "application/x-pc2",
    "model/gltf-binary",
    "model/obj",
    "model/vnd.usda",
    "model/x-ply",
)
#: Fast levels: a shape is computed in a millisecond, and higher ones cost ten times that for a few percent.
_ZSTD, _BROTLI, _GZIP = 3, 4, 2
_TAGGED = re.compile(r'-(zstd|br|gzip)(?=")')


class Coding:
    """Compress answers to clients from elsewhere; `always` those from this machine as well, `off` none."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self._when = settings.compress

    @cached_property
    def _compress(self) -> ASGIApp:
        """What compresses: made for the first who takes it, for its codecs take a while to load."""
        from starlette_compress import CompressMiddleware, add_compress_type

        for media_type in _TYPES:
            add_compress_type(media_type)
        return CompressMiddleware(
            self.app, minimum_size=_LEAST, zstd_level=_ZSTD, brotli_quality=_BROTLI, gzip_level=_GZIP
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and compress what comes back."""
        if scope["type"] != "http" or not self._wanted(scope):
            await self.app(scope, receive, send)
            return
        known = Headers(scope=scope).get("if-none-match", "")
        plain = _TAGGED.sub("", known)
        if plain != known:
            kept = [pair for pair in scope["headers"] if pair[0] != b"if-none-match"]
            scope = {**scope, "headers": [*kept, (b"if-none-match", plain.encode("latin-1"))]}

        async def tagged(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                tag, coding = headers.get("etag"), headers.get("content-encoding")
                if tag and message["status"] == 304:
                    # the tag that the client has, in its own spelling
                    mine = [part.strip() for part in known.split(",") if _TAGGED.sub("", part.strip()) == tag]
                    headers["etag"] = mine[0] if mine else tag
                    headers.add_vary_header("Accept-Encoding")  # caches take these words over to what they keep
                elif tag and coding:
                    headers["etag"] = f'{tag[:-1]}-{coding}"'
            await send(message)

        await self._compress(scope, receive, tagged)

    def _wanted(self, scope: Scope) -> bool:
        return self._when == "always" or (self._when == "elsewhere" and not _here(scope))


def _here(scope: Scope) -> bool:
    """Return whether a client sits on this machine, where bytes cost less than compressing them."""
    return _is_loopback((scope.get("client") or ("",))[0])


@lru_cache(maxsize=4096)
def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return True  # a Unix socket
