"""The ledger from the shards, which are the truth."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from sqlite3 import Connection
from typing import TYPE_CHECKING

from ..canonical import canonical
from .database import Database

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["learn", "rebuild"]


def rebuild(database: Database, results: Iterable[xr.Dataset]) -> int:
    """Make a ledger's file say what results say; return how many there are.

    Each becomes a done job; a job noted as done whose result is not among them waits again. What ends meanwhile stays:
    its result may have come after those that were listed.
    """
    with database.read() as connection:
        gone = {
            row["key"]: row["claims"] for row in connection.execute("SELECT key, claims FROM jobs WHERE state = 'done'")
        }
    count = 0
    for dataset in results:
        with database.write() as connection:
            _note(connection, dataset)
        gone.pop(dataset.attrs["key"], None)
        count += 1
    with database.write() as connection:
        connection.executemany(
            "UPDATE jobs SET state = 'wanted', attempts = 0, failures = 0, digest = NULL, progress = 0, "
            "updated = ? WHERE state = 'done' AND key = ? AND claims = ?",
            [(time.time(), *claim) for claim in gone.items()],
        )
    return count


def learn(database: Database, results: Iterable[xr.Dataset]) -> int:
    """Let a ledger's file know of results that came without it; return how many. What runs is its worker's to end."""
    count = 0
    for dataset in results:
        with database.write() as connection:
            count += _note(connection, dataset, "WHERE state NOT IN ('running', 'done')")
    return count


def _note(connection: Connection, dataset: xr.Dataset, only: str = "") -> int:
    """Enter a result as a done job, within a transaction; return how many were."""
    attrs, now = dataset.attrs, time.time()
    return connection.execute(
        "INSERT INTO jobs (key, solver, version, params, need, state, digest, seconds, created, updated, "
        "progress) VALUES (?, ?, ?, ?, ?, 'done', ?, ?, ?, ?, 1) ON CONFLICT (key) DO UPDATE SET "
        "state = 'done', digest = excluded.digest, error = NULL, worker = NULL, lease_until = NULL, "
        f"progress = 1, updated = excluded.updated {only}",
        (
            attrs["key"],
            str(attrs.get("solver", "")),
            str(attrs.get("solver_version", "")),
            canonical(json.loads(attrs.get("params", "{}"))).decode(),
            canonical(json.loads(attrs.get("need", "{}"))).decode(),
            attrs["digest"],
            float(dataset["seconds"].max()) if "seconds" in dataset else None,
            now,
            now,
        ),
    ).rowcount
