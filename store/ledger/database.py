"""One SQLite file in WAL mode: short transactions, safe among threads, forks and processes."""

from __future__ import annotations

import os
import sqlite3
import threading
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path

from .. import seal
from ..errors import CorruptLedger, MissingStore, ReadOnlyStore, StorageFailed, StorageFull
from .filesystem import refuse_network

__all__ = ["Database", "ask_the_system", "readable"]

#: Seconds to wait for another process's transaction; each lasts milliseconds.
_PATIENCE = 60.0
#: What a ledger takes at least when it is opened [bytes]: its index of the log.
_LEAST = 1 << 15

#: Connections inherited through a fork: SQLite forbids to use or to close them in the child.
_inherited: list[sqlite3.Connection] = []


def readable(path: Path) -> str:
    """Return the address by which SQLite opens a file to read it only, whatever its name holds: `#`, `?`, `%`."""
    address = f"{path.absolute().as_uri()}?mode=ro"
    log = path.with_name(f"{path.name}-wal")
    # without a log nobody has it open; to read it all the same SQLite would begin one, which it may not here
    unused = not log.exists() or not log.stat().st_size
    return f"{address}&immutable=1" if unused and _guarded(path) else address


def _guarded(path: Path) -> bool:
    """Return whether a file lies where we may not write beside it: another's directory, or a disk that is read only."""
    return not os.access(path.parent, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


def _identity(path: Path) -> tuple[int, int] | None:
    """Return what tells a file from another one of its name; None where there is none."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino


def ask_the_system(path: Path) -> None:
    """Write beside a database what it needs at least: SQLite keeps to itself what the system told it.

    Raises:
        StorageFull, StorageFailed, ReadOnlyStore: as the system says now.

    """
    with seal.scratch(path) as trial:
        trial.write_bytes(bytes(_LEAST))
        seal.sync(trial)


class Database:
    """A connection that opens itself on first use, in every process anew.

    `schema` is a list of statements that may be said again: `CREATE ... IF NOT EXISTS`. `upgrades` make a file of an
    earlier version one of the next; the version is kept in the file.
    """

    def __init__(self, path: Path, schema: str, upgrades: Mapping[int, str]) -> None:
        self._path = path
        self._schema = schema
        self._upgrades = upgrades
        self._version = 1 + max(upgrades, default=0)
        self._pid = os.getpid()
        self._lock = threading.RLock()
        self._connection: sqlite3.Connection | None = None
        self._file: tuple[int, int] | None = None

    def close(self) -> None:
        """Close the connection; the next use opens it again."""
        with self._own_lock():
            if self._connection is not None:
                self._connection.close()
                self._connection = None

    def __del__(self) -> None:
        if self._connection is not None and self._pid == os.getpid():
            self._connection.close()

    @property
    def version(self) -> int:
        """What this program writes, and the latest that it reads."""
        return self._version

    @contextmanager
    def read(self) -> Iterator[sqlite3.Connection]:
        """Yield a connection that sees one state of the file.

        Raises:
            CorruptLedger: the file is no database, or one of another version.
            ReadOnlyStore: it may not be written, and is of an earlier version or in use.
            NetworkFileSystem: it is where locks do not hold.
            StorageFailed: the disk does not work, or another program keeps the file locked.
            MissingStore: the directory that it was in is gone.

        """
        with self._transaction("DEFERRED") as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """Yield a connection that alone may write; all of it is on the disk on leaving, or nothing on an error.

        Raises:
            CorruptLedger: the file is no database, or one of another version.
            ReadOnlyStore: it may not be written.
            StorageFull: the disk is full.
            StorageFailed: it does not work, or another program keeps the file locked.
            MissingStore: the directory that it was in is gone.

        """
        with self._transaction("IMMEDIATE") as connection:
            yield connection

    @contextmanager
    def _transaction(self, kind: str) -> Iterator[sqlite3.Connection]:
        with self._own_lock(), self._typed():
            self._keep_up()
            if kind == "DEFERRED" and self._connection is None and self._path.is_file() and _guarded(self._path):
                with closing(self._look()) as connection:
                    yield connection
                return
            connection = self._connection or self._open()
            connection.execute(f"BEGIN {kind}")
            try:
                yield connection
                connection.execute("COMMIT")
            except BaseException:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")
                raise

    def _keep_up(self) -> None:
        """Let go of a file that was deleted, or put away for a restored store: what is written to it nobody reads."""
        if self._connection is not None and self._file not in (None, _identity(self._path)):
            self.close()

    def _own_lock(self) -> threading.RLock:
        if self._pid != os.getpid():
            if self._connection is not None:
                _inherited.append(self._connection)
            self._pid, self._lock, self._connection = os.getpid(), threading.RLock(), None
        return self._lock

    def _look(self) -> sqlite3.Connection:
        """Return a connection for one look at a file that we may not change."""
        refuse_network(self._path)
        connection = sqlite3.connect(readable(self._path), uri=True, timeout=_PATIENCE, isolation_level=None)
        try:
            connection.row_factory = sqlite3.Row
            connection.execute("BEGIN DEFERRED")
            found = connection.execute("PRAGMA user_version").fetchone()[0]
            if found > self._version:
                raise self._newer(found)
            if found < self._version:
                said = f"{self._path} has version {found}, and cannot be written to make it {self._version}."
                raise ReadOnlyStore(said, "Copy the store, and look at the copy.")
        except BaseException:
            connection.close()
            raise
        return connection

    def _open(self) -> sqlite3.Connection:
        refuse_network(self._path)
        root = self._path.parent.absolute()
        if not root.is_dir():  # a store is begun by who opens it, and this one was moved away
            raise MissingStore(f"there is no store in {root}.", "Put it back, or name where it is now.")
        connection = sqlite3.connect(self._path, timeout=_PATIENCE, isolation_level=None, check_same_thread=False)
        try:
            connection.row_factory = sqlite3.Row
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")  # what was reported as done survives a power cut
            connection.execute("BEGIN IMMEDIATE")
            found = connection.execute("PRAGMA user_version").fetchone()[0]
            if found > self._version:
                raise self._newer(found)
            changes = [self._upgrades[old] for old in range(found, self._version)] if found else []
            # what is there already stays: a table that a later program added appears in older files too
            for statement in ";".join([*changes, self._schema]).split(";"):
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {self._version}")
            connection.execute("COMMIT")
        except BaseException:
            connection.close()
            raise
        self._connection, self._file = connection, _identity(self._path)
        return connection

    @contextmanager
    def _typed(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.DatabaseError as error:
            name = getattr(error, "sqlite_errorname", "")
            if name == "SQLITE_FULL":
                raise StorageFull(f"there is no space left to write {self._path}.", "Free space and go on.") from error
            if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
                advice = "End the program that has it open and does not go on; then run the same command again."
                raise StorageFailed(f"another program keeps {self._path} locked.", advice) from error
            if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_IOERR")):
                ask_the_system(self._path)
            if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN")):
                raise ReadOnlyStore(f"{self._path} cannot be written.", "Name a store of your own.") from error
            if name.startswith("SQLITE_IOERR"):
                advice = "Look at the disk and its free space; then run the same command again."
                raise StorageFailed(f"the disk could not read or write {self._path} ({name}).", advice) from error
            if name in ("SQLITE_NOTADB", "SQLITE_CORRUPT"):
                raise self._unreadable(f"is not a sound database ({error})") from error
            raise

    def _newer(self, found: int) -> CorruptLedger:
        return CorruptLedger(
            f"{self._path} has version {found}, this program reads {self._version}.",
            "Install the wizen that wrote it; or restore a backup from before, or delete it (with its -wal "
            "and -shm files) and rebuild it from the shards: who asked for what is lost then.",
        )

    def _unreadable(self, why: str) -> CorruptLedger:
        return CorruptLedger(
            f"{self._path} {why}.", "Delete it (with its -wal and -shm files) and rebuild it from the shards."
        )
