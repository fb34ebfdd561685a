"""The ledger: which results are wanted, who computes them until when, which are done, which were given up.

SQLite in WAL mode, safe among threads and processes of one machine (not on a network file system: there, only the
coordinating process opens it). The shards are the truth; the ledger can be rebuilt from them.

A claim is fenced: the job that `claim` returned, with its worker and the number of the claim, goes with every word
about it. A worker whose job was taken over or cancelled meanwhile changes nothing, and is told so.
"""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..canonical import canonical
from ..errors import UnknownJob
from .clock import Clock
from .database import Database
from .jobs import STATES, Job, JobSpec, State, read_row
from .leases import Leases
from .recovery import learn, rebuild
from .rows import SELECT, among, enter, get
from .schema import SCHEMA, UPGRADES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MAX_LOST", "Ledger"]

#: A job that took its worker down this often (out of memory, a crash) is given up.
MAX_LOST = 5
#: The claim that a job's worker holds, or gave back without anybody having taken the job since.
_HELD = "key = ? AND claims = ? AND (worker = ? OR worker IS NULL AND state = 'wanted')"
_RUNS = "state = 'running'"

_LOST = {
    "code": "worker-lost",
    "message": f"the worker disappeared {MAX_LOST} times while computing this.",
    "advice": "Give it more memory or a coarser need, then ask again with again=True.",
}


class Ledger:
    """Jobs by key. A job moves wanted -> running -> done, or back to wanted, or to failed or cancelled.

    `clock` measures the leases.
    """

    def __init__(self, path: Path | str, clock: Clock | None = None) -> None:
        self.path = Path(path)
        self.database = Database(self.path, SCHEMA, UPGRADES)
        self._leases = Leases(clock or Clock.of_host())

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.path,)

    def close(self) -> None:
        """Close the connection; the next call opens it again."""
        self.database.close()

    def want(self, jobs: Iterable[JobSpec], plan: str = "", again: bool = False) -> int:
        """Ask for jobs; return how many now wait that did not before. Asking twice changes nothing.

        What is done stays done. What was cancelled waits again; what failed for good only with `again=True`.
        """
        revived: tuple[State, ...] = ("cancelled", "failed") if again else ("cancelled",)
        count = 0
        with self.database.write() as connection:
            for job in jobs:
                count += enter(connection, job, plan, revived)
        return count

    def claim(self, worker: str, lease: float, keys: Collection[str] | None = None) -> Job | None:
        """Take the oldest job that waits, or whose worker let its lease run out; None if there is none.

        `lease` [s] is how long the job is `worker`'s unless renewed; `keys` restricts the choice. No two claims ever
        return the same job while its lease lasts. What is returned is the claim: `renew`, `done`, `failed` and
        `release` want it back.
        """
        now = time.time()
        among = "" if keys is None else "AND key IN (SELECT value FROM json_each(?))"
        listed = () if keys is None else (json.dumps(sorted(keys)),)
        with self.database.write() as connection:
            late = json.dumps(self._leases.late(connection))
            connection.execute(
                "UPDATE jobs SET state = 'failed', error = ?, worker = NULL, lease_until = NULL, updated = ? "
                "WHERE key IN (SELECT value FROM json_each(?)) AND attempts >= ?",
                (json.dumps(_LOST), now, late, MAX_LOST),
            )
            row = connection.execute(
                "SELECT key FROM jobs WHERE (state = 'wanted' OR state = 'running' AND key IN "
                f"(SELECT value FROM json_each(?))) {among} ORDER BY created, rowid LIMIT 1",
                (late, *listed),
            ).fetchone()
            if row is None:
                return None
            connection.execute(
                "UPDATE jobs SET state = 'running', worker = ?, clock = ?, lease = ?, lease_until = ?, "
                "attempts = attempts + 1, claims = claims + 1, progress = 0, updated = ? WHERE key = ?",
                (worker, *self._leases.until(lease), now, row["key"]),
            )
            connection.execute("DELETE FROM notes WHERE key = ?", (row["key"],))
            return get(connection, row["key"])

    def renew(self, job: Job, lease: float, progress: float | None = None, message: str = "") -> bool:
        """Keep a claimed job for `lease` [s] more and note its progress, 0 to 1, and what it says.

        False means that the job is no longer its claimant's (cancelled, or taken over): it should stop.
        """
        with self.database.write() as connection:
            changed = connection.execute(
                "UPDATE jobs SET clock = ?, lease = ?, lease_until = ?, progress = coalesce(?, progress), updated = ? "
                f"WHERE {_HELD} AND state = 'running'",
                (*self._leases.until(lease), progress, time.time(), *_held(job)),
            ).rowcount
            if changed and message:
                connection.execute("INSERT OR REPLACE INTO notes VALUES (?, ?)", (job.key, message))
        return changed == 1

    def done(self, job: Job, digest: str, seconds: float) -> bool:
        """Note that the result of a claimed job is stored. Call it only after the shard is on the disk.

        False means that the job is no longer its claimant's, and is left alone: whoever has it finds the shard.
        """
        return self._end(
            job, "state = 'done', digest = ?, seconds = ?, progress = 1, error = NULL, worker = NULL", digest, seconds
        )

    def failed(self, job: Job, error: Mapping[str, Any], max_attempts: int = 2) -> State | None:
        """Note a failure (`code`, `message`, `advice`) of a claimed job and return the job's new state.

        It waits again until it has failed `max_attempts` times, then it is failed for good. What its claimant noted as
        done before stays done. None means that the job is no longer its claimant's, and is left alone.
        """
        with self.database.write() as connection:
            try:
                found = get(connection, job.key)
            except UnknownJob:  # this ledger was begun after the claim
                return None
            if found.state == "done" and found.claims == job.claims:
                return "done"
            # a claimant that was lost has not failed: only MAX_LOST of those give a job up
            state: State = "failed" if found.failures + 1 >= max_attempts else "wanted"
            changed = connection.execute(
                "UPDATE jobs SET state = ?, error = ?, failures = failures + 1, worker = NULL, lease_until = NULL, "
                f"updated = ? WHERE {_HELD} AND state = 'running'",
                (state, json.dumps(error), time.time(), *_held(job)),
            ).rowcount
        return state if changed else None

    def release(self, job: Job) -> bool:
        """Put a claimed job back as if it had not been claimed: its worker was asked to stop.

        False means that the job is no longer its claimant's, and is left alone.
        """
        change = "state = 'wanted', attempts = max(attempts - 1, 0), progress = 0, worker = NULL"
        return self._end(job, change, only=_RUNS)

    def lost(self, job: Job) -> bool:
        """Put a claimed job back whose worker is dead, or give it up: it may be what took its workers down.

        False means that the job is no longer its claimant's, and is left alone.
        """
        if job.attempts >= MAX_LOST:
            return self._end(job, "state = 'failed', error = ?, worker = NULL", json.dumps(_LOST), only=_RUNS)
        return self._end(job, "state = 'wanted', progress = 0, worker = NULL", only=_RUNS)

    def cancel(self, keys: Iterable[str]) -> int:
        """Give up jobs that wait or run; return how many. A running worker learns of it when it renews."""
        with self.database.write() as connection:
            return sum(
                connection.execute(
                    "UPDATE jobs SET state = 'cancelled', worker = NULL, lease_until = NULL, updated = ? "
                    "WHERE key = ? AND state IN ('wanted', 'running')",
                    (time.time(), key),
                ).rowcount
                for key in keys
            )

    def get(self, key: str) -> Job:
        """Return a job.

        Raises:
            UnknownJob: nobody asked for it.

        """
        with self.database.read() as connection:
            return get(connection, key)

    def jobs(self, state: State | None = None, plan: str | None = None) -> list[Job]:
        """Return the jobs of a state and a plan (None: any), oldest first."""
        where, values = among(plan)
        if state is not None:
            where, values = f"{where} AND state = ?", (*values, state)
        with self.database.read() as connection:
            rows = connection.execute(f"{SELECT} WHERE {where} ORDER BY created, jobs.rowid", values)
            return [read_row(row) for row in rows]

    def alike(self, job: JobSpec) -> list[Job]:
        """Return the jobs of the same solver, version and parameters, whatever they need, oldest first."""
        values = job.solver, job.version, canonical(job.params).decode()
        with self.database.read() as connection:
            where = "WHERE solver = ? AND version = ? AND params = ? ORDER BY created, jobs.rowid"
            return [read_row(row) for row in connection.execute(f"{SELECT} {where}", values)]

    def running(self, worker: str) -> list[Job]:
        """Return the jobs that a worker holds."""
        with self.database.read() as connection:
            rows = connection.execute(f"{SELECT} WHERE state = 'running' AND worker = ?", (worker,))
            return [read_row(row) for row in rows]

    def counts(self, plan: str | None = None) -> dict[str, int]:
        """Return how many jobs (of a plan) are in each state; every state is listed."""
        where, values = among(plan)
        with self.database.read() as connection:
            rows = connection.execute(f"SELECT state, count(*) FROM jobs WHERE {where} GROUP BY state", values)
            return {**dict.fromkeys(STATES, 0), **{row[0]: row[1] for row in rows}}

    def rebuild(self, results: Iterable[xr.Dataset]) -> int:
        """Make the ledger say what the shards say; return how many results there are (`Store.results` yields them).

        Each result becomes a done job; a job noted as done whose result is not among them waits again.
        """
        return rebuild(self.database, results)

    def learn(self, results: Iterable[xr.Dataset]) -> int:
        """Note results as done that are not, and are nobody's; return how many. All else stays as it is."""
        return learn(self.database, results)

    def _end(self, job: Job, change: str, *values: Any, only: str = "1") -> bool:
        """Apply `change` to a job that is still as `job`, the claim, says; return whether it is."""
        with self.database.write() as connection:
            changed = connection.execute(
                f"UPDATE jobs SET {change}, lease_until = NULL, updated = ? WHERE {_HELD} AND {only}",
                (*values, time.time(), *_held(job)),
            ).rowcount
        return changed == 1


def _held(job: Job) -> tuple[Any, ...]:
    """Return the values of `_HELD`."""
    return job.key, job.claims, job.worker
