"""Who asked for which job, and what it took: the audit, and quotas by seconds of solver time.

A token is known by its id and its name, never by its secret.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from sqlite3 import Connection
from typing import NamedTuple

from ..errors import QuotaSpent
from .database import Database

__all__ = ["Ask", "Asker", "Spending", "asks", "check", "note"]

#: The asks of one somebody since a time; `after` are the claims by the time of the next one for the same job.
_ASKS = "(SELECT *, lead(claims) OVER (PARTITION BY key ORDER BY rowid) AS after FROM asks WHERE {} = ? AND at > ?)"
#: What an ask is charged with: what its run took, else what it is expected to take once it was or will be begun, which
#: claims tell: they never go back. What was asked for again is charged again if it was begun, for then it began anew.
_CHARGE = (
    "CASE WHEN asks.after > asks.claims THEN asks.expected WHEN asks.after IS NOT NULL THEN 0 "
    "WHEN jobs.state = 'done' THEN coalesce(jobs.seconds, asks.expected) "
    "WHEN jobs.state = 'cancelled' AND jobs.claims = asks.claims THEN 0 ELSE asks.expected END"
)


@dataclass(frozen=True)
class Asker:
    """Somebody who asks for runs: a token's id and name, and the address that it came from."""

    id: str
    name: str = ""
    client: str = ""


@dataclass(frozen=True)
class Spending:
    """How many seconds of solver time one token, and one address, may ask for within `window` [s]; None: any."""

    token: float | None = None
    client: float | None = None
    window: float = 86400.0


class Ask(NamedTuple):
    """One line of the audit. `seconds` is None for what has not ended well."""

    at: float
    token: str
    name: str
    client: str
    key: str
    solver: str
    state: str
    expected: float
    seconds: float | None


def note(connection: Connection, key: str, asker: Asker, expected: float) -> None:
    """Note within a transaction that somebody asked for a run that is expected to take so many seconds."""
    row = (asker.id, asker.name, asker.client, time.time(), expected, key)
    # of a run that goes on already, its asker has a part
    connection.execute(
        "INSERT INTO asks SELECT key, ?, ?, ?, ?, ?, claims - (state = 'running') FROM jobs WHERE key = ?", row
    )


def check(connection: Connection, asker: Asker, expected: float, spending: Spending) -> None:
    """Refuse within a transaction what would take more than is left.

    Raises:
        QuotaSpent: saying when there will be room.

    """
    since = time.time() - spending.window
    for column, who, most in (("token", asker.id, spending.token), ("client", asker.client, spending.client)):
        if most is None or not who:
            continue
        rows = connection.execute(
            f"SELECT asks.at, {_CHARGE} FROM {_ASKS.format(column)} AS asks "
            "JOIN jobs ON jobs.key = asks.key ORDER BY asks.at",
            (who, since),
        ).fetchall()
        spent = sum(charge for _, charge in rows)
        if spent + expected <= most:
            continue
        over, free = spent + expected - most, time.time() + spending.window
        for at, charge in rows:
            over -= charge
            if over <= 0:
                free = at + spending.window
                break
        when = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(free))
        whose = "this token" if column == "token" else "this address"
        raise QuotaSpent(
            f"{whose} has asked for {spent:.0f} s of solver time in {spending.window / 3600:g} h; with about "
            f"{expected:.0f} s more it would be over {most:g} s.",
            f"Ask for less, or from {when} on." if expected <= most else "Ask for less.",
        )


def asks(database: Database, since: float = 0.0, token: str | None = None) -> list[Ask]:
    """Return who asked for what since a time [s since the epoch], oldest first; `token` is a name or an id."""
    with database.read() as connection:
        rows = connection.execute(
            "SELECT asks.at, asks.token, asks.name, asks.client, asks.key, coalesce(jobs.solver, ''), "
            "coalesce(jobs.state, 'unknown'), asks.expected, CASE WHEN jobs.state = 'done' THEN jobs.seconds END "
            "FROM asks LEFT JOIN jobs ON jobs.key = asks.key WHERE asks.at >= ? AND (? IS NULL OR ? IN (name, token)) "
            "ORDER BY asks.at, asks.rowid",
            (since, token, token),
        )
        return [Ask(*row) for row in rows]
