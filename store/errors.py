"""What can go wrong with data at rest. Every error has a stable code, says what happened and what to do about it."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

__all__ = [
    "NO_DAMAGE",
    "Advised",
    "CorruptBackup",
    "CorruptLedger",
    "CorruptShard",
    "CorruptTable",
    "CorruptTokens",
    "EmptyTable",
    "InvalidToken",
    "MissingStore",
    "MixedSamples",
    "NetworkFileSystem",
    "OutsideTable",
    "QueueFull",
    "QuotaSpent",
    "ReadOnlyStore",
    "StaleTable",
    "StorageFailed",
    "StorageFull",
    "StoreError",
    "TooUncertain",
    "UnknownJob",
    "UnknownTable",
    "UnknownToken",
    "full_disk",
]

#: What reading a file may end with although nothing is wrong with the file.
NO_DAMAGE = (FileNotFoundError, PermissionError, ImportError)

_BROKEN = {errno.EIO, errno.EREMOTEIO, errno.ENXIO}
_REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS}
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


class Advised(Exception):
    """What is refused or cannot be done, and what to change. `code` is stable."""

    code: ClassVar[str] = "error"

    def __init__(self, message: str, advice: str = "") -> None:
        super().__init__(message, advice)
        self.message = message
        self.advice = advice

    def __str__(self) -> str:
        return f"{self.message} {self.advice}".strip()


class StoreError(Advised):
    """Something the store refuses or cannot do. `code` is stable; `advice` says what to change."""

    code: ClassVar[str] = "store-error"


class MissingStore(StoreError):
    """There is no store in the named directory."""

    code = "missing-store"


class CorruptShard(StoreError):
    """A stored result is damaged, or is not the result that its name says."""

    code = "corrupt-shard"


class CorruptTable(StoreError):
    """A table's manifest or generation file is damaged."""

    code = "corrupt-table"


class CorruptLedger(StoreError):
    """The ledger is not a database that this version can read."""

    code = "corrupt-ledger"


class UnknownTable(StoreError):
    """No table has that name."""

    code = "unknown-table"


class StaleTable(StoreError):
    """A table of another version of its solver: its shapes are not those that this version solves."""

    code = "stale-table"


class EmptyTable(StoreError):
    """There is nothing to build a table from."""

    code = "empty-table"


class OutsideTable(StoreError):
    """A query that the table cannot answer: off its axes or stages, or for something that it does not hold."""

    code = "outside-table"


class TooUncertain(StoreError):
    """The answer would be worse than the query allows."""

    code = "too-uncertain"


class MixedSamples(StoreError):
    """Results that differ in something that is not an axis cannot be interpolated in one table."""

    code = "mixed-samples"


class QueueFull(StoreError):
    """As many jobs wait as may."""

    code = "queue-full"


class QuotaSpent(StoreError):
    """Somebody has asked for as much solver time as he may."""

    code = "quota-spent"


class NetworkFileSystem(StoreError):
    """The ledger would lie where the locks of two machines do not see each other."""

    code = "network-file-system"


class ReadOnlyStore(StoreError):
    """A store that takes nothing new: the one in the package, or one that belongs to somebody else."""

    code = "read-only-store"


class StorageFull(StoreError):
    """The disk or a quota is full. Nothing half-written stays."""

    code = "storage-full"


class CorruptBackup(StoreError):
    """A backup is not what was copied."""

    code = "corrupt-backup"


class StorageFailed(StoreError):
    """The disk could not read or write. Nothing half-written stays."""

    code = "storage-failed"


class UnknownJob(StoreError):
    """No job or result has that key."""

    code = "unknown-job"


class CorruptTokens(StoreError):
    """The file of access tokens is damaged."""

    code = "corrupt-tokens"


class InvalidToken(StoreError):
    """A token that cannot be made as asked for."""

    code = "invalid-option"


class UnknownToken(StoreError):
    """No token has that name."""

    code = "unknown-token"


@contextmanager
def full_disk(path: Path) -> Iterator[None]:
    """Turn the system's ways of saying 'no space' while writing `path` into `StorageFull`, and others into sentences.

    Raises:
        StorageFull: no space, over quota, or over the file size limit.
        StorageFailed: the disk does not work.
        ReadOnlyStore: the path may not be written.

    """
    try:
        yield
    except OSError as error:
        if _met(error, _BROKEN):
            advice = "Look at the disk (dmesg, smartctl); then run the same command again, here or on a copy."
            raise StorageFailed(f"the disk could not write {path} ({error}).", advice) from error
        if _met(error, _REFUSED):
            raise ReadOnlyStore(f"{path} cannot be written.", "Name a store of your own.") from error
        if not _met(error, _FULL):
            raise
        raise StorageFull(
            f"there is no space left to write {path}.",
            "Free space or move the store; then run the same command again.",
        ) from error


def _met(error: OSError, numbers: set[int]) -> bool:
    """Return whether the system gave one of these numbers; HDF5 reports them only inside its message."""
    return error.errno in numbers or any(f"errno = {number}," in str(error) for number in numbers)
