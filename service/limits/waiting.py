"""Connections whose request has not come yet: on their way for a while, and held without a look after it.

Who is late is told so and let go, as long as they are few. A crowd of them is no bad line but somebody who comes back
at once, and each time costs some thirty times what it costs to leave him where he is: so late ones of a crowd are held.
They are read no more, have a small buffer in the system, and go when they leave or when their room is needed.
"""

from __future__ import annotations

import asyncio
import select
import socket
from typing import Protocol

__all__ = ["Late", "Waiting"]

#: So many that wait at once are a crowd.
_CROWD = 64
#: How often is looked who of those that are held has left [s]; and within which part of the time they have, others are
#: told at once that it is over.
_LOOK, _GRAIN = 1.0, 0.02
#: What the system keeps for a connection that is held [bytes].
_BUFFER = 4096
#: "The other end has closed", where the system tells; elsewhere only that the connection is broken.
_LEFT = getattr(select, "POLLRDHUP", 0) | select.POLLHUP | select.POLLERR


class Late(Protocol):
    """What may wait here."""

    def late(self) -> None:
        """Tell the other end that its time is over, and let it go."""

    def hold(self) -> socket.socket | None:
        """Read no more; return the socket, for as long as it is open."""

    def leave(self) -> None:
        """Close: the other end has."""


class Waiting:
    """Who waits, of one event loop: one timer for all of them, since all have the same time."""

    def __init__(self, loop: asyncio.AbstractEventLoop, patience: float) -> None:
        self._loop, self._patience = loop, patience
        #: Until when each may take, the longest awaited first.
        self._until: dict[Late, float] = {}
        self._held: dict[Late, int] = {}
        self._by_file: dict[int, Late] = {}
        self._poll = select.poll()
        self._timer: asyncio.TimerHandle | None = None

    @property
    def crowded(self) -> bool:
        """Whether so many wait that they are no accident."""
        return len(self._until) + len(self._held) > _CROWD

    @property
    def held(self) -> int:
        """How many are held."""
        return len(self._held)

    @property
    def first(self) -> Late | None:
        """Whose place to give to somebody else: of those held, else of all, the one that came first."""
        return next(iter(self._held), None) or next(iter(self._until), None)

    def add(self, who: Late) -> None:
        """Wait for somebody's request."""
        self._until[who] = self._loop.time() + self._patience
        self._arm()

    def drop(self, who: Late) -> None:
        """Forget somebody: the request is there, or nobody waits for it any more."""
        self._until.pop(who, None)
        file = self._held.pop(who, None)
        if file is not None:
            self._by_file.pop(file)
            self._poll.unregister(file)

    def hold(self, who: Late) -> None:
        """Keep somebody without a look until he leaves, or his room is needed."""
        self._until.pop(who, None)
        line = who.hold()
        if line is None:
            return
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        file = line.fileno()
        self._held[who], self._by_file[file] = file, who
        self._poll.register(file, _LEFT)
        self._arm()

    def _arm(self) -> None:
        if self._timer is not None or not (self._until or self._held):
            return
        first = next(iter(self._until.values()), None)
        pause = self._patience if first is None else max(first - self._loop.time(), 0) + _GRAIN * self._patience
        self._timer = self._loop.call_later(min(pause, _LOOK) if self._held else pause, self._look)

    def _look(self) -> None:
        self._timer = None
        now = self._loop.time()
        late = []
        for who, until in self._until.items():
            if until > now:
                break
            late.append(who)
        for who in late:
            if self.crowded:
                self.hold(who)
            else:
                who.late()
        if self._held:
            for file, _ in self._poll.poll(0):
                who = self._by_file[file]
                self.drop(who)
                who.leave()
        self._arm()
