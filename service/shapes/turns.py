"""Shapes computed in the event loop take turns, in the order in which they were asked.

Between two of them the loop makes a few passes: it takes new connections (uvloop one in each pass), reads requests and
sends what the sockets take. Without turns, all that is read in one pass would be computed in a row, and a newcomer
would wait for several such rows.
"""

from __future__ import annotations

import asyncio
from types import TracebackType

from ..errors import Overloaded

__all__ = ["Turns"]


#: Passes of the loop between two turns while others wait.
_PASSES = 1


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
        """Let the next one have his turn after a few passes of the loop."""
        self._leave(_PASSES)

    def _leave(self, passes: int) -> None:
        if self._waiting and passes:
            asyncio.get_running_loop().call_soon(self._leave, passes - 1)
        else:
            self._lock.release()
