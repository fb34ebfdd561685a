"""Who has which session, how many there may be, what they have cost, and when they end."""

from __future__ import annotations

import asyncio
import secrets
import time
from typing import Any

from store.ledger.asks import Asker, Spending
from store.ledger.live import RENEW, Held, LiveTally
from store.store import Store
from store.tokens import Token

from ..errors import TooManySessions, UnknownSession
from ..settings import Settings
from .session import Session

__all__ = ["Sessions"]

#: Seconds between two looks at what has had its time.
_LOOK = 1.0


class Sessions:
    """The sessions of this process of the service; how many there may be is counted over all of them, in the ledger."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        hours = 3600 * settings.quota_hours
        self._spending = Spending(settings.max_seconds_per_token, settings.max_seconds_per_client, hours)
        self._open: dict[str, Session] = {}
        self._known: LiveTally | None = None
        self._watch: asyncio.Task[None] | None = None
        #: What sends clients away, by the sessions that end so.
        self._leaving: dict[str, asyncio.Task[None]] = {}

    async def open(self, asker: Asker, unlimited: bool, asked: dict[str, object]) -> Session:
        """Begin a session, checked by the caller but for its quotas.

        Raises:
            TooManySessions: there is no room, or no time left.
            InvalidInput: the engine cannot begin.
            ReadOnlyStore: the store's ledger, where sessions are counted, cannot be written.

        """
        id = f"s_{secrets.token_hex(8)}"
        if unlimited:
            await self._tell("enter_anyway", id, asker)
        else:
            await self._renew()  # what they have cost until now counts
            limits = self._settings
            most, own = limits.max_sessions, limits.max_sessions_per_token
            held = await self._tell("enter", id, asker, most, own, self._spending)
            if held is not None:
                raise self._refused(held)
        try:
            session = await Session.begin(id, asker, asked)
        except BaseException:
            await asyncio.shield(self._tell("leave", id, 0.0))
            raise
        session.limited = not unlimited
        self._open[session.id] = session
        if self._watch is None or self._watch.done():
            self._watch = asyncio.create_task(self._watching())
        return session

    async def _renew(self) -> None:
        if self._open:
            await self._tell("renew", {session.id: session.spent for session in self._open.values()})

    async def _tell(self, what: str, *words: Any) -> Any:
        """Say something to the ledger, in a thread: another process may be writing."""

        def say() -> Any:
            if self._known is None:
                self._known = LiveTally(Store.open(self._settings.store).ledger.database)
            return getattr(self._known, what)(*words)

        return await asyncio.to_thread(say)

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

    def _refused(self, held: Held) -> TooManySessions:
        limits = self._settings
        if held.open >= limits.max_sessions:
            return TooManySessions(
                f"{held.open} sessions are open already, of {limits.max_sessions} that may be.",
                advice="Try again later, or run it as a job.",
            )
        if held.own >= limits.max_sessions_per_token:
            return TooManySessions(f"{held.own} sessions of this token are open already.", advice="Close one.")
        most = limits.max_seconds_per_token
        of, spent = ("token", held.token) if most is not None and held.token >= most else ("address", held.client)
        most = most if of == "token" else limits.max_seconds_per_client
        return TooManySessions(
            f"this {of} has spent {spent:.0f} s of {most or 0:g} s on sessions in {limits.quota_hours:g} h.",
            advice="Wait until there is room again.",
        )

    async def close(self, session: Session) -> None:
        """End a session."""
        mine = self._open.pop(session.id, None) is not None
        await session.end()
        if mine:
            await self._tell("leave", session.id, session.spent)

    async def close_all(self) -> None:
        """End all: the service stops."""
        for task in (self._watch, *self._leaving.values()):
            if task is not None:
                task.cancel()
        for session in list(self._open.values()):
            await self.close(session)

    async def _watching(self) -> None:
        """End what nobody wants any more, or what has had its time."""
        renewed = time.monotonic()
        while self._open:
            await asyncio.sleep(_LOOK)
            if time.monotonic() - renewed > RENEW:
                renewed = time.monotonic()
                await self._renew()
            for session in list(self._open.values()):
                why = None if session.id in self._leaving else self._over(session)
                if why:
                    self._leaving[session.id] = asyncio.create_task(self._dismissed(session, why))

    async def _dismissed(self, session: Session, why: tuple[int, str]) -> None:
        """Send a session's client away, and end it; no other one waits for what its engine takes to save."""
        try:
            await session.dismiss(*why)
            await self.close(session)
        finally:
            del self._leaving[session.id]

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
