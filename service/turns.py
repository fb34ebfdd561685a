"""Shapes computed in the event loop take turns: one for each pass of the loop, in the order in which they were asked.

Between two of them the loop sends what the sockets take and reads what has come. Without turns, all requests that are
read in one pass would be computed in a row, and whoever waits for the second half of his answer waits for all of them.
"""

from __future__ import annotations

import asyncio
from types import TracebackType

from .errors import Overloaded

__all__ = ["Turns"]


class Turns:
    """Turns of at most `most` that wait, as an asynchronous context; of one event loop."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._waiting = 0
        self._lock = asyncio.Lock()

    @property
    def waiting(self) -> int:
        """How many wait."""
        return self._waiting

    async def __aenter__(self) -> None:
        """Wait for one's turn.

        Raises:
            Overloaded: too many wait already.

        """
        if self._waiting >= self._most:
            raise Overloaded(
                f"{self._waiting} shapes are waiting to be computed.",
                advice="Ask again in a second, ask for many in one batch, or start more workers.",
            )
        self._waiting += 1
        try:
            await self._lock.acquire()
        finally:
            self._waiting -= 1

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let the next one have his turn, in the loop's next pass."""
        self._lock.release()
