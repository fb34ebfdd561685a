"""Live sessions of all processes that serve a store: who has how many, and what they have cost.

A session is its process's as long as that says so: an entry lapses when it was not renewed for `LEASE`, by the clock of
leases, so that one of a process that was killed takes nobody's room. Seconds count whether it ended well or not.
"""

from __future__ import annotations

import time
from sqlite3 import Connection
from typing import NamedTuple

from .asks import Asker, Spending
from .clock import Clock
from .database import Database

__all__ = ["LEASE", "RENEW", "Held", "LiveTally"]

#: Seconds for which an entry holds, and after how many it is to be renewed.
LEASE, RENEW = 20.0, 5.0


class Held(NamedTuple):
    """What stands against a session: sessions open in all and of the token; seconds spent of token and of address."""

    open: int
    own: int
    token: float
    client: float


class LiveTally:
    """The count in a ledger."""

    def __init__(self, database: Database, clock: Clock | None = None) -> None:
        self._database, self._clock = database, clock or Clock.of_host()

    def enter(self, id: str, asker: Asker, most: int, own: int, spending: Spending) -> Held | None:
        """Count a session that is about to begin, and return None; or return what is held where there is no room."""
        with self._database.write() as connection:
            connection.execute("DELETE FROM sessions WHERE at < ?", (time.time() - max(spending.window, 86400.0),))
            held = self._held(connection, asker, spending)
            limits = ((held.token, spending.token), (held.client, spending.client))
            spent = any(limit is not None and seconds >= limit for seconds, limit in limits)
            if held.open >= most or held.own >= own or spent:
                return held
            self._write(connection, id, asker)
        return None

    def enter_anyway(self, id: str, asker: Asker) -> None:
        """Count one that no limit holds for."""
        with self._database.write() as connection:
            self._write(connection, id, asker)

    def renew(self, seconds: dict[str, float]) -> None:
        """Say that sessions go on, and what they have cost so far [s]."""
        now = time.time()
        with self._database.write() as connection:
            for id, spent in seconds.items():
                row = (spent, now, self._clock.name, self._clock.now() + LEASE, id)
                connection.execute("UPDATE sessions SET seconds = ?, at = ?, clock = ?, lease = ? WHERE id = ?", row)

    def leave(self, id: str, seconds: float) -> None:
        """Say that a session has ended, and what it has cost [s]."""
        with self._database.write() as connection:
            row = (seconds, time.time(), id)
            connection.execute("UPDATE sessions SET seconds = ?, at = ?, lease = NULL WHERE id = ?", row)

    def _write(self, connection: Connection, id: str, asker: Asker) -> None:
        row = (id, asker.id, asker.name, asker.client, time.time(), self._clock.name, self._clock.now() + LEASE)
        connection.execute("INSERT INTO sessions VALUES (?, ?, ?, ?, ?, 0, ?, ?)", row)

    def _held(self, connection: Connection, asker: Asker, spending: Spending) -> Held:
        alive = "lease IS NOT NULL AND clock = ? AND lease > ?"
        ours = (self._clock.name, self._clock.now())
        everybody = connection.execute(f"SELECT count(*) FROM sessions WHERE {alive}", ours).fetchone()[0]
        own = connection.execute(f"SELECT count(*) FROM sessions WHERE {alive} AND token = ?", (*ours, asker.id))
        since = time.time() - spending.window
        spent = [
            connection.execute(
                f"SELECT coalesce(sum(seconds), 0.0) FROM sessions WHERE at > ? AND {column} = ?", (since, who)
            ).fetchone()[0]
            for column, who in (("token", asker.id), ("client", asker.client))
        ]
        return Held(everybody, own.fetchone()[0], *spent)
