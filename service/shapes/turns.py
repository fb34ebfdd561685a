"""Shapes computed in the event loop take turns, in the order in which they were asked.

Between two of them the loop makes a few passes: it takes new connections, reads requests and sends what the sockets
take. Without turns, all that is read in one pass would be computed in a row, and a newcomer would wait for several such
rows. uvloop takes one connection in a pass: as long as there come more, more passes are made, or a crowd of newcomers
would queue before the door, where nobody is told that there is too much to do.
"""

from __future__ import annotations

import asyncio
from types import TracebackType

from ..errors import Overloaded
from ..limits import connections

__all__ = ["Turns"]

#: Passes of the loop between two turns while others wait or come: that many after the last connection was taken, which
#: shows a pass late, and at most so many in all. One that takes a connection and refuses its request costs a tenth of a
#: shape.
_PASSES, _MOST_PASSES = 2, 4


class Turns:
    """Turns of at most `most` that wait, as an asynchronous context; of one event loop."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._waiting = 0
        self._taken = 0
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
        self._leave(0, 0)

    def _leave(self, passes: int, quiet: int) -> None:
        taken, self._taken = self._taken, connections.taken()
        has_come = self._taken > taken
        quiet = 0 if has_come else quiet
        if (self._waiting or has_come or passes) and quiet < _PASSES and passes < _MOST_PASSES:
            asyncio.get_running_loop().call_soon(self._leave, passes + 1, quiet + 1)
        else:
            self._lock.release()
