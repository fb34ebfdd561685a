"""WebSockets count among their client's connections, like all others."""

from __future__ import annotations

from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from .clients import address
from .connections import forget

__all__ = ["GuardedSocket"]


class GuardedSocket(WebSocketsSansIOProtocol):
    """A connection that `GuardedProtocol` has counted, and whose head it has read, before it became a WebSocket."""

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(*values, **named)
        self._server = named["server_state"]

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget a connection."""
        forget(self._server, address(self.client[0]) if self.client else "")
        super().connection_lost(exc)
