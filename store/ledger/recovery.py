"""The ledger from the shards, which are the truth."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from ..canonical import canonical
from .database import Database

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["rebuild"]


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
        attrs, now = dataset.attrs, time.time()
        key = attrs["key"]
        seconds = float(dataset["seconds"].max()) if "seconds" in dataset else None
        with database.write() as connection:
            connection.execute(
                "INSERT INTO jobs (key, solver, version, params, need, state, digest, seconds, created, updated, "
                "progress) VALUES (?, ?, ?, ?, ?, 'done', ?, ?, ?, ?, 1) ON CONFLICT (key) DO UPDATE SET "
                "state = 'done', digest = excluded.digest, error = NULL, worker = NULL, lease_until = NULL, "
                "progress = 1, updated = excluded.updated",
                (
                    key,
                    str(attrs.get("solver", "")),
                    str(attrs.get("solver_version", "")),
                    canonical(json.loads(attrs.get("params", "{}"))).decode(),
                    canonical(json.loads(attrs.get("need", "{}"))).decode(),
                    attrs["digest"],
                    seconds,
                    now,
                    now,
                ),
            )
        gone.pop(key, None)
        count += 1
    with database.write() as connection:
        connection.executemany(
            "UPDATE jobs SET state = 'wanted', attempts = 0, failures = 0, digest = NULL, progress = 0, "
            "updated = ? WHERE state = 'done' AND key = ? AND claims = ?",
            [(time.time(), *claim) for claim in gone.items()],
        )
    return count
