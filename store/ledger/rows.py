"""Jobs within a transaction: entered, read, and chosen by plan."""

from __future__ import annotations

import time
from collections.abc import Sequence
from sqlite3 import Connection
from typing import Any

from ..canonical import canonical
from ..errors import UnknownJob
from .jobs import Job, JobSpec, State, read_row

__all__ = ["QUEUE", "SELECT", "among", "enter", "get"]

#: The plan of all jobs that are asked for one by one, see `queue`; `queue:<owner>` is that of one asker.
QUEUE = "queue"

#: Reads whole jobs.
SELECT = "SELECT jobs.*, notes.message FROM jobs LEFT JOIN notes ON notes.key = jobs.key"


def enter(connection: Connection, job: JobSpec, plan: str, revived: Sequence[State]) -> int:
    """Ask for a job within a transaction; return 1 if it waits now and did not before.

    A job in one of the states `revived` waits again, for who asks now: what others had asked for one by one has ended.
    """
    now = time.time()
    texts = canonical(job.params).decode(), canonical(job.need).decode()
    count = connection.execute(
        "INSERT INTO jobs (key, solver, version, params, need, plan, state, created, updated) "
        "VALUES (?, ?, ?, ?, ?, ?, 'wanted', ?, ?) ON CONFLICT (key) DO UPDATE SET "
        "state = 'wanted', attempts = 0, failures = 0, error = NULL, worker = NULL, progress = 0, "
        f"updated = excluded.updated WHERE state IN ({','.join('?' * len(revived))})",
        (job.key, job.solver, job.version, *texts, plan, now, now, *revived),
    ).rowcount
    if count:
        ended = job.key, QUEUE, f"{QUEUE}:*"
        connection.execute("DELETE FROM plans WHERE key = ? AND (plan = ? OR plan GLOB ?)", ended)
    if plan:
        connection.execute("INSERT OR IGNORE INTO plans VALUES (?, ?)", (plan, job.key))
    return count


def get(connection: Connection, key: str) -> Job:
    """Return a job within a transaction.

    Raises:
        UnknownJob: nobody asked for it.

    """
    row = connection.execute(f"{SELECT} WHERE jobs.key = ?", (key,)).fetchone()
    if row is None:
        raise UnknownJob(f"there is no job {key}.", "Ask for it first.")
    return read_row(row)


def among(plan: str | None) -> tuple[str, tuple[Any, ...]]:
    """Return a condition that chooses the jobs of a plan (None: all), and its values."""
    return ("1", ()) if plan is None else ("jobs.key IN (SELECT key FROM plans WHERE plan = ?)", (plan,))
