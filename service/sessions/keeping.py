"""Who has which session, how many there may be, what they have cost, and when they end."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections import deque
from typing import NamedTuple

from store.ledger.asks import Asker
from store.tokens import Token

from ..errors import TooManySessions, UnknownSession
from ..settings import Settings
from .session import Session

__all__ = ["Sessions"]

#: Seconds between two looks at what has had its time.
_LOOK = 1.0


class _Spent(NamedTuple):
    """Processor seconds of a session that has ended."""

    at: float
    asker: Asker
    seconds: float


class Sessions:
    """The sessions of this process of the service."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._open: dict[str, Session] = {}
        #: Those that are about to begin, by who asked.
        self._begun: list[Asker] = []
        self._spent: deque[_Spent] = deque()
        self._watch: asyncio.Task[None] | None = None

    async def open(self, asker: Asker, unlimited: bool, asked: dict[str, object]) -> Session:
        """Begin a session, checked by the caller but for its quotas.

        Raises:
            TooManySessions: there is no room, or no time left.
            InvalidInput: the engine cannot begin.

        """
        if not unlimited:
            self._check(asker)
        self._begun.append(asker)
        try:
            session = await Session.begin(f"s_{secrets.token_hex(8)}", asker, asked)
        finally:
            self._begun.remove(asker)
        session.limited = not unlimited
        self._open[session.id] = session
        if self._watch is None or self._watch.done():
            self._watch = asyncio.create_task(self._watching())
        return session

    def find(self, id: object, key: object, solver: str, token: Token) -> Session:
        """Return the session that a client had.

        Raises:
            UnknownSession: there is none of that name here, or it is not theirs.

        """
        found = self._open.get(str(id))
        if found is None or found.solver != solver or found.asker.id != token.id or not found.is_key(str(key)):
            raise UnknownSession(
                f"there is no session {str(id)[:40]!r} of yours.",
                advice="It has ended, or another process of the service has it: open a new one with saved parameters.",
            )
        return found

    def _check(self, asker: Asker) -> None:
        limits = self._settings
        askers = [session.asker for session in self._open.values()] + self._begun
        if len(askers) >= limits.max_sessions:
            raise TooManySessions(
                f"{len(askers)} sessions are open already, of {limits.max_sessions} that may be.",
                advice="Try again later, or run it as a job.",
            )
        own = sum(one.id == asker.id for one in askers)
        if own >= limits.max_sessions_per_token:
            raise TooManySessions(f"{own} sessions of this token are open already.", advice="Close one.")
        for of, most in (("token", limits.max_seconds_per_token), ("address", limits.max_seconds_per_client)):
            spent = self._of(asker, of)
            if most is not None and spent >= most:
                hours = limits.quota_hours
                raise TooManySessions(
                    f"this {of} has spent {spent:.0f} s of {most:g} s on sessions in {hours:g} h.",
                    advice="Wait until there is room again.",
                )

    def _of(self, asker: Asker, of: str) -> float:
        """Return processor seconds that a token's or an address's sessions took within the quota's hours."""
        while self._spent and self._spent[0].at < time.time() - 3600 * self._settings.quota_hours:
            self._spent.popleft()

        def same(other: Asker) -> bool:
            return other.id == asker.id if of == "token" else other.client == asker.client

        ended = sum(one.seconds for one in self._spent if same(one.asker))
        return ended + sum(session.spent for session in self._open.values() if same(session.asker))

    async def close(self, session: Session) -> None:
        """End a session."""
        if self._open.pop(session.id, None) is not None:
            self._spent.append(_Spent(time.time(), session.asker, session.spent))
        await session.end()

    async def close_all(self) -> None:
        """End all: the service stops."""
        if self._watch is not None:
            self._watch.cancel()
        for session in list(self._open.values()):
            await self.close(session)

    async def _watching(self) -> None:
        """End what nobody wants any more, or what has had its time."""
        while self._open:
            await asyncio.sleep(_LOOK)
            for session in list(self._open.values()):
                why = self._over(session)
                if why:
                    await session.dismiss(*why)
                    await self.close(session)

    def _over(self, session: Session) -> tuple[int, str] | None:
        """Return status and reason where a session has to end."""
        limits, now = self._settings, time.monotonic()
        if session.has_died:
            return 500, "the engine ended of itself."
        if not session.is_attached:
            return (408, "nobody came back.") if now - session.left > limits.session_kept else None
        if now - session.heard > limits.session_idle:
            return 408, f"nothing came for {limits.session_idle:g} s."
        if session.limited and session.spent > limits.session_seconds:
            return 429, f"it has taken {session.spent:.0f} s of a processor, of {limits.session_seconds:g} s."
        return None
