"""The queue: jobs that are asked for one by one, by somebody, rather than by a plan.

In the ledger they belong to the plan `queue`, and to one per asker, so that whoever empties the queue leaves the jobs
of stopped sweeps alone, and one asker's change of mind takes nothing from another.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from sqlite3 import Connection

from ..errors import QueueFull
from . import asks
from .asks import Asker, Spending
from .jobs import Job, JobSpec, State, read_row
from .ledger import Ledger
from .rows import QUEUE, SELECT, enter, get

__all__ = ["Queue", "Quota"]


@dataclass(frozen=True)
class Quota:
    """How many jobs may wait or run at once, of everybody and of one asker, and how much time may be asked for."""

    total: int
    own: int
    spending: Spending = field(default_factory=Spending)


class Queue:
    """The queue in a ledger; safe among threads and processes, as that is."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._database = ledger.database

    def ask(
        self,
        job: JobSpec,
        owner: str | Asker,
        quota: Quota | None = None,
        *,
        again: bool = False,
        lost: bool = False,
        expected: float = 0.0,
    ) -> tuple[Job, bool]:
        """Ask for a job in the name of `owner`; return it, and whether it waits now and did not before.

        It is expected to take so many seconds, which are noted with who asked, and count for the quota.

        What was cancelled waits again; what failed for good with `again`, what is done with `lost`: its shard is gone.

        Raises:
            QueueFull, QuotaSpent: the quota is used up; asking for what is asked for already always works.

        """
        revivable: dict[State, bool] = {"cancelled": True, "failed": again, "done": lost}
        revived = [state for state, whether in revivable.items() if whether]
        asker = owner if isinstance(owner, Asker) else Asker(owner)
        mine = _plan(asker.id)
        with self._database.write() as connection:
            row = connection.execute("SELECT state FROM jobs WHERE key = ?", (job.key,)).fetchone()
            state = "cancelled" if row is None else row["state"]
            adds = state in revived or (state in ("wanted", "running") and not _has(connection, mine, job.key))
            if adds and quota is not None:
                _check(connection, mine, quota)
                asks.check(connection, asker, expected, quota.spending)
            new = enter(connection, job, QUEUE, revived)
            connection.execute("INSERT OR IGNORE INTO plans VALUES (?, ?)", (mine, job.key))
            if adds:
                asks.note(connection, job.key, asker, expected)
            return get(connection, job.key), new == 1

    def withdraw(self, key: str, owner: str) -> tuple[Job, bool]:
        """Take back that `owner` asked for a job; return it, and whether `owner` had asked.

        It is cancelled unless somebody else wants it too; a running worker learns of it when it renews.

        Raises:
            UnknownJob: nobody asked for it.

        """
        with self._database.write() as connection:
            job = get(connection, key)
            if not _has(connection, _plan(owner), key):
                return job, False
            if job.state in ("wanted", "running"):
                self._leave(connection, key, owner)
            return get(connection, key), True

    def _leave(self, connection: Connection, key: str, owner: str) -> None:
        connection.execute("DELETE FROM plans WHERE plan = ? AND key = ?", (_plan(owner), key))
        others = {row[0] for row in connection.execute("SELECT plan FROM plans WHERE key = ?", (key,))} - {QUEUE}
        if not any(plan.startswith(_plan("")) for plan in others):
            connection.execute("DELETE FROM plans WHERE plan = ? AND key = ?", (QUEUE, key))
        if not others:
            connection.execute(
                "UPDATE jobs SET state = 'cancelled', worker = NULL, lease_until = NULL, updated = ? WHERE key = ?",
                (time.time(), key),
            )

    def waiting(self) -> list[Job]:
        """Return the queue's jobs that wait or run, oldest first."""
        with self._database.read() as connection:
            rows = connection.execute(
                f"{SELECT} WHERE state IN ('wanted', 'running') AND jobs.key IN "
                "(SELECT key FROM plans WHERE plan = ?) ORDER BY created, jobs.rowid",
                (QUEUE,),
            )
            return [read_row(row) for row in rows]

    def page(self, state: State | None, count: int, before: int | None = None) -> tuple[list[Job], int | None]:
        """Return up to `count` jobs of the ledger, newest first, and from where the next page goes on, if there is one.

        `before` is where the page before said that the next one goes on.
        """
        where, values = ["1"], list[object]()
        if state is not None:
            where, values = ["state = ?"], [state]
        if before is not None:
            where.append("jobs.rowid < ?")
            values.append(before)
        # one more than asked for, to know whether there is a next page
        text = f"{SELECT.replace('SELECT', 'SELECT jobs.rowid AS place,', 1)} WHERE {' AND '.join(where)}"
        with self._database.read() as connection:
            rows = connection.execute(f"{text} ORDER BY jobs.rowid DESC LIMIT ?", (*values, count + 1)).fetchall()
        found = [dict(row) for row in rows]
        places = [row.pop("place") for row in found]
        more = places[count - 1] if len(found) > count else None
        return [read_row(row) for row in found[:count]], more


def _plan(owner: str) -> str:
    return f"{QUEUE}:{owner}"


def _has(connection: Connection, plan: str, key: str) -> bool:
    return connection.execute("SELECT 1 FROM plans WHERE plan = ? AND key = ?", (plan, key)).fetchone() is not None


def _open(connection: Connection, plan: str) -> int:
    count = connection.execute(
        "SELECT count(*) FROM jobs WHERE state IN ('wanted', 'running') "
        "AND key IN (SELECT key FROM plans WHERE plan = ?)",
        (plan,),
    )
    return int(count.fetchone()[0])


def _check(connection: Connection, mine: str, quota: Quota) -> None:
    if _open(connection, mine) >= quota.own:
        raise QueueFull(f"{quota.own} of your jobs wait or run already.", "Wait for one to end, or cancel one.")
    if _open(connection, QUEUE) >= quota.total:
        raise QueueFull(f"{quota.total} jobs wait or run already.", "Wait for some to end.")
