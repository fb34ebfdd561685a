"""Who is let in while there is more to do than time: whatever would wait too long is told so at once.

How long a newcomer would wait is what is under way times the mean interval at which the service has finished requests
while it was busy (Little's law), whatever they cost and wherever they are computed. Past `max_delay` he is refused:
an answer that comes too late costs as much as one in time, and is of use to nobody. Past half of it, those are refused
who had more than their share of the last seconds of work, so that one client's flood leaves room for the others.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable

from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from store.tokens import Tokens

from .. import problems
from ..errors import Overloaded
from .clients import client_of

__all__ = ["Admission", "Load", "refusal"]

#: Weight of the last interval in the mean, and by how much one may stand out from it: a table that is opened once
#: says nothing about what comes after it.
_NEWEST, _OUTLIER, _OUTLIER_LEAST = 0.1, 4.0, 0.05
#: Seconds after which work that was done for a client counts for 1/e, and beyond how many equal shares it is too much.
_MEMORY, _GREED = 10.0, 1.5
#: Most clients that are remembered.
_CLIENTS = 4096


class Load:
    """What is under way, how fast it is worked off, and for whom. `free` requests at once are always let in."""

    def __init__(self, free: int, longest: float, now: Callable[[], float] = time.monotonic) -> None:
        self._free, self._longest, self._now = free, longest, now
        self._interval = 0.0
        self._last = 0.0
        #: Work done for each client [s], as of when; the least recent first.
        self._work: OrderedDict[str, tuple[float, float]] = OrderedDict()
        self.under_way = 0

    @property
    def delay(self) -> float:
        """How long a request would take that is let in now [s]."""
        return (self.under_way + 1) * self._interval

    def refused(self, client: str | None) -> float | None:
        """Return None if a client's request is let in, else the seconds after which it is worth another try.

        Without a client it is refused where anybody's would be.
        """
        delay = self.delay
        if client is not None:
            self._spent(client)  # whoever asks counts, let in or not
        if self.under_way < self._free or delay <= self._longest / 2:
            return None
        if delay > self._longest or (client is not None and self._greedy(client)):
            return max(1.0, delay)
        return None

    def enter(self) -> None:
        """Count a request that was let in."""
        if not self.under_way:
            self._last = self._now()
        self.under_way += 1

    def leave(self, client: str, is_done: bool = True) -> None:
        """Count a request as finished, and the time since the last one did as work for its client.

        One that was refused after all is none: counted, it would say that the service is fast.
        """
        if not is_done:
            self.under_way -= 1
            return
        now = self._now()
        passed = now - self._last
        self._last = now
        self.under_way -= 1
        usual = min(passed, max(_OUTLIER * self._interval, _OUTLIER_LEAST))
        self._interval += (_NEWEST if self._interval else 1.0) * (usual - self._interval)
        self._work[client] = self._spent(client) + passed, now

    def _spent(self, client: str) -> float:
        """Return the work that was lately done for a client [s], and remember that it asked."""
        now = self._now()
        spent, then = self._work.get(client, (0.0, now))
        spent *= math.exp((then - now) / _MEMORY)
        self._work[client] = spent, now
        self._work.move_to_end(client)
        while len(self._work) > _CLIENTS or now - next(iter(self._work.values()))[1] > _MEMORY:
            self._work.popitem(last=False)
        return spent

    def _greedy(self, client: str) -> bool:
        now = self._now()
        work = {name: spent * math.exp((then - now) / _MEMORY) for name, (spent, then) in self._work.items()}
        return len(work) > 1 and work[client] > _GREED / len(work) * sum(work.values())


class Admission:
    """Refuses what would wait too long, before anything is computed for it. Looking at jobs, tables and the service's
    health costs next to nothing and always passes.
    """

    def __init__(self, app: ASGIApp, load: Load, tokens: Tokens) -> None:
        self.app = app
        self.load = load
        self.tokens = tokens

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if there is room for it; it counts until its answer begins."""
        if scope["type"] != "http" or not _is_work(scope["path"]):
            await self.app(scope, receive, send)
            return
        client, load = client_of(scope, self.tokens), self.load
        response = refusal(load, scope, client)
        if response is not None:
            await response(scope, receive, send)
            return
        begun = False

        def begin(is_done: bool) -> None:
            nonlocal begun
            if not begun:
                begun = True
                load.leave(client, is_done)

        async def watched(message: Message) -> None:
            begin(message.get("status") != 503)  # what is being sent waits for its reader, not for us
            await send(message)

        load.enter()
        try:
            await self.app(scope, receive, watched)
        finally:
            begin(is_done=True)


def refusal(load: Load, scope: Scope, client: str | None) -> Response | None:
    """Return what to answer to a request that there is no time for, None if there is; without a `client` nobody knows
    who sends it.
    """
    if not _is_work(scope["path"]):
        return None
    wait = load.refused(client)
    if wait is None:
        return None
    # unless one before us did
    scope.setdefault("state", {}).setdefault("request_id", problems.identify(scope))
    error = Overloaded(
        f"there is more to do than time: the answer would take about {wait:.0f} s.",
        advice="Ask again after that, ask for many in one batch, or start more workers.",
        headers={"Retry-After": str(math.ceil(wait))},
    )
    return problems.of(error, scope)


def _is_work(path: str) -> bool:
    return path.startswith(("/v1/shapes", "/v1/scenes", "/v1/match")) or path.endswith("/result")
