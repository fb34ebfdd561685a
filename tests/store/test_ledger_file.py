"""The file that a ledger is in: of others, of earlier versions, locked, or not to be written."""

from __future__ import annotations

import contextlib
import os
import sqlite3
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from store.errors import CorruptLedger, MissingStore, QuotaSpent, ReadOnlyStore, StorageFailed
from store.ledger import database
from store.ledger.asks import Asker, Spending, asks
from store.ledger.ledger import Ledger
from store.ledger.queue import Queue, Quota

from .test_ledger import Counter, claim, job

#: The table of jobs as it was before claims were numbered.
_FIRST = """
CREATE TABLE jobs (
    key TEXT PRIMARY KEY, solver TEXT NOT NULL, version TEXT NOT NULL, params TEXT NOT NULL, need TEXT NOT NULL,
    plan TEXT NOT NULL DEFAULT '', state TEXT NOT NULL, attempts INTEGER NOT NULL DEFAULT 0, worker TEXT,
    lease_until REAL, digest TEXT, error TEXT, seconds REAL, created REAL NOT NULL, updated REAL NOT NULL,
    progress REAL NOT NULL DEFAULT 0
);
INSERT INTO jobs (key, solver, version, params, need, state, attempts, worker, lease_until, created, updated) VALUES
    ('a', 's', '1', '{}', '{}', 'done', 1, NULL, NULL, 1, 2),
    ('b', 's', '1', '{}', '{}', 'running', 1, 'old:1:2', 9e9, 1, 2);
PRAGMA user_version = 1;
"""


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    return Ledger(tmp_path / "ledger.sqlite")


@contextlib.contextmanager
def as_another(directory: Path) -> Iterator[None]:
    """Be, for a while, somebody who may not write in a directory."""
    root, mode = os.geteuid() == 0, directory.stat().st_mode
    directory.chmod(0o555)
    if root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)
        directory.chmod(mode)


def test_a_ledger_that_may_not_be_written_is_read() -> None:
    """Another's, or on a disk that is read only; SQLite by itself would begin a log beside it."""
    with tempfile.TemporaryDirectory() as name:
        ledger = Ledger(Path(name, "ledger.sqlite"))
        ledger.want([job("a"), job("b")], plan="p")
        claimed = claim(ledger)
        assert ledger.done(claimed, "digest", 1.0)
        ledger.close()
        with as_another(Path(name)):
            assert ledger.counts()["done"] == 1
            assert [found.key for found in ledger.jobs("wanted")] == ["b"]
            with pytest.raises(ReadOnlyStore, match="cannot be written"):
                ledger.want([job("c")])
            assert [path.name for path in Path(name).iterdir()] == ["ledger.sqlite"]
        assert ledger.want([job("c")]) == 1
        assert ledger.counts()["wanted"] == 2
        ledger.database.close()
        with contextlib.closing(sqlite3.connect(ledger.path)) as connection:
            connection.execute("PRAGMA user_version = 1")
        with as_another(Path(name)), pytest.raises(ReadOnlyStore, match="Copy the store"):
            ledger.counts()


def test_a_ledger_that_was_deleted_is_not_written_to(ledger: Ledger, tmp_path: Path) -> None:
    """As the documents have it deleted where it is damaged, while a service has it open."""
    ledger.want([job("a"), job("b")])
    claimed = claim(ledger)
    for path in tmp_path.glob("ledger.sqlite*"):
        path.unlink()
    assert ledger.failed(claimed, {"code": "x"}) is None, "nobody knows of that claim any more"
    ledger.want([job("c")])
    other = Ledger(ledger.path)
    assert [one.key for one in other.jobs()] == ["c"], "who opens it now reads what is written now"
    other.want([job("d")])
    assert [one.key for one in ledger.jobs()] == ["c", "d"]


def test_a_ledger_that_was_restored_in_its_place_is_read(tmp_path: Path) -> None:
    kept, store = Ledger(tmp_path / "kept" / "ledger.sqlite"), tmp_path / "store"
    kept.path.parent.mkdir()
    store.mkdir()
    kept.want([job("before")])
    kept.close()
    ledger = Ledger(store / "ledger.sqlite")
    ledger.want([job("after")])
    store.rename(tmp_path / "away")
    for _ in range(2):
        with pytest.raises(MissingStore, match="no store"):
            ledger.want([job("nowhere")])
    assert not store.exists()
    (tmp_path / "kept").rename(store)
    assert [one.key for one in ledger.jobs()] == ["before"]
    assert [one.key for one in Ledger(tmp_path / "away" / "ledger.sqlite").jobs()] == ["after"]


def test_a_file_that_is_no_ledger(ledger: Ledger) -> None:
    ledger.path.write_bytes(b"not a database, but long enough to look at" * 100)
    with pytest.raises(CorruptLedger, match="rebuild"):
        ledger.counts()


def test_a_ledger_that_another_program_keeps_locked_is_said(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(database, "_PATIENCE", 0.05)
    ledger.want([job("a")])
    with contextlib.closing(sqlite3.connect(ledger.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StorageFailed, match="keeps"):
            ledger.want([job("b")])
        assert ledger.counts()["wanted"] == 1
    ledger.want([job("b")])


def test_an_older_file_gains_what_was_added_since(tmp_path: Path) -> None:
    path = tmp_path / "ledger.sqlite"
    Ledger(path).counts()
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute("DROP TABLE notes")
    assert Ledger(path).jobs() == []


def test_a_ledger_of_the_first_version_is_upgraded(tmp_path: Path) -> None:
    path, counter = tmp_path / "ledger.sqlite", Counter("here")
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.executescript(_FIRST)
    upgraded = Ledger(path, counter.clock)
    assert asks(upgraded.database) == []
    assert [(j.key, j.state, j.claims) for j in upgraded.jobs()] == [("a", "done", 0), ("b", "running", 0)]
    # its leases were dates: they are watched, like those of another clock
    assert upgraded.claim("w", 30.0) is None
    counter.seconds = 100.0
    assert claim(upgraded).key == "b"
    with contextlib.closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (4,)
        connection.execute("PRAGMA user_version = 5")
    with pytest.raises(CorruptLedger, match="version 5"):
        Ledger(path).counts()


def test_asks_of_an_older_file_are_kept(tmp_path: Path) -> None:
    """They say nothing of claims: what was begun since the file began counts for the last of them."""
    path = tmp_path / "ledger.sqlite"
    Queue(Ledger(path)).ask(job("a"), Asker("t"), expected=40.0)
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute("ALTER TABLE asks DROP COLUMN claims")
        connection.execute("PRAGMA user_version = 3")
        connection.commit()
    upgraded = Ledger(path)
    with pytest.raises(QuotaSpent, match="asked for 40 s"):
        Queue(upgraded).ask(job("b"), Asker("t"), Quota(9, 9, Spending(token=50.0)), expected=20.0)
    assert len(asks(upgraded.database)) == 1
