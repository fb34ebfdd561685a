"""Backups: a store that is copied while others write, killed at any moment, and brought back as it was."""

from __future__ import annotations

import errno
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from solver.dehydration import SOLVER
from store import shards, tables
from store.copies import backup as copies
from store.copies.backup import backup, restore
from store.errors import CorruptBackup, CorruptLedger, CorruptTable, MissingStore, ReadOnlyStore, StorageFull
from store.store import Store
from store.tokens import Tokens

from .conftest import fill, make, python, spec


@pytest.fixture
def own(tmp_path: Path) -> Store:
    """A small store with something of everything in it."""
    store = Store.open(tmp_path / "store", create=True)
    fill(store, te=[0.03, 0.04], resolution=8)
    tables.build(store, SOLVER)
    Tokens(store.root).create("mine", ["run"])
    store.keep_plan("plums", "# a plan")
    return store


def test_there_and_back(own: Store, tmp_path: Path) -> None:
    own.ledger.want([spec(te=0.06, resolution=8)])
    running = own.ledger.claim("worker", 60)
    assert running is not None
    copied = backup(own, tmp_path / "copy")
    assert copied.new == copied.files - 1  # all but the ledger, which is always taken anew
    shutil.rmtree(own.root)
    restore(tmp_path / "copy", tmp_path / "again")
    again = Store.open(tmp_path / "again")
    assert len(list(again.results())) == 2
    assert again.ledger.counts()["done"] == 2
    assert again.ledger.get(running.key).state == "wanted", "nobody works on it here"
    assert not again.ledger.release(running), "a claim of the other store means nothing"
    tables.open(again).close()
    assert [token.name for token in Tokens(again.root).all()] == ["mine"]
    assert again.plan("plums") == "# a plan"
    assert (again.root / "tokens.json").stat().st_mode & 0o077 == 0
    (secrets,) = (tmp_path / "copy").rglob("tokens.json")
    assert secrets.stat().st_mode & 0o077 == 0


def test_a_second_backup_copies_what_is_new(own: Store, tmp_path: Path) -> None:
    first = backup(own, tmp_path / "copy")
    fill(own, te=[0.05], resolution=8)
    second = backup(own, tmp_path / "copy")
    assert second.files == first.files + 1
    # the new shard, the manifest, the plan and the tokens
    assert second.new == 4
    assert len(list((tmp_path / "copy" / "changing").iterdir())) == 1
    restore(tmp_path / "copy", tmp_path / "again")
    assert len(list(Store.open(tmp_path / "again").results())) == 3


def test_what_is_refused(own: Store, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    with pytest.raises(ReadOnlyStore, match="something else"):
        backup(own, tmp_path / "other")
    with pytest.raises(ReadOnlyStore, match="something else"):
        backup(own, own.root)
    with pytest.raises(MissingStore, match="no backup"):
        restore(tmp_path / "other", tmp_path / "new")
    backup(own, tmp_path / "copy")
    with pytest.raises(ReadOnlyStore, match="not empty"):
        restore(tmp_path / "copy", own.root)
    shard = next((tmp_path / "copy").glob("shards/*/*.h5"))
    data = bytearray(shard.read_bytes())
    data[100] ^= 1
    shard.write_bytes(data)
    with pytest.raises(CorruptBackup, match="not what was copied"):
        restore(tmp_path / "copy", tmp_path / "new")
    shard.unlink()
    with pytest.raises(CorruptBackup, match="missing"):
        restore(tmp_path / "copy", tmp_path / "new")
    page = tmp_path / "copy" / "backup.json"
    page.write_text(page.read_text().replace("tokens.json", "../tokens.json"))
    with pytest.raises(CorruptBackup, match="outside"):
        restore(tmp_path / "copy", tmp_path / "new")
    assert not (tmp_path / "new").exists()
    assert not list(tmp_path.glob(".*.restoring"))


COPY = """
import sys, time
from pathlib import Path
from typing import Any
from store.copies import backup as copies
from store.copies.backup import backup, restore
from store.store import Store
print("go", flush=True)
while True:
    begun = time.monotonic()  # one clock for all processes
    backup(Store.open(sys.argv[1]), Path(sys.argv[2]))
    print(begun, flush=True)
"""


def test_killed_at_any_moment(own: Store, tmp_path: Path) -> None:
    """While results come in: what a backup said that it had copied comes back, whenever its process dies."""
    said: set[str] = set()
    for i in range(4):
        copying = python(COPY, own.root, tmp_path / "copy")
        assert copying.stdout is not None
        assert copying.stdout.readline() == "go\n"
        (new,) = fill(own, te=[0.05 + 0.001 * i], resolution=8)
        there = time.monotonic()
        while float(copying.stdout.readline()) < there:
            pass  # begun before the result was there
        said.add(new)
        time.sleep(0.01 * i)
        copying.send_signal(signal.SIGKILL)
        copying.wait()
        copying.stdout.close()
        target = tmp_path / f"again{i}"
        restore(tmp_path / "copy", target)
        again = Store.open(target)
        assert said <= set(again.keys())
        done = {job.key for job in again.ledger.jobs("done")}
        assert done <= set(again.keys())
        assert again.get(make(te=0.03, resolution=8)[0]) is not None
        tables.open(again).close()
    backup(own, tmp_path / "copy")
    assert not list((tmp_path / "copy").rglob("*.part"))


@pytest.mark.parametrize("name", ["a#b", "50%25", "what?mode=rwc", "a b ü"])
def test_a_store_of_any_name_comes_back_with_its_ledger(own: Store, tmp_path: Path, name: str) -> None:
    """SQLite takes its file for an address, in which these signs mean something."""
    odd = Store.open(own.root.rename(tmp_path / name))
    before = {path.name for path in tmp_path.iterdir()}
    backup(odd, tmp_path / "copy")
    restore(tmp_path / "copy", tmp_path / "again")
    assert Store.open(tmp_path / "again").ledger.counts()["done"] == 2
    assert {path.name for path in tmp_path.iterdir()} == before | {"copy", "again"}


def test_a_ledger_that_is_none_is_said(own: Store, tmp_path: Path) -> None:
    own.ledger.close()
    own.ledger.path.write_bytes(b"not a database, but long enough to look at" * 100)
    with pytest.raises(CorruptLedger, match="cannot be read"):
        backup(own, tmp_path / "copy")


def test_two_backups_into_one_directory_at_once(own: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A timer's and one by hand: the second is refused, for it would take away what the first has copied."""
    copy, refused = copies._copy, []

    def meanwhile(*values: Any, **named: Any) -> Any:
        if not refused:
            with pytest.raises(ReadOnlyStore, match="another command") as said:
                backup(own, tmp_path / "copy")
            refused.append(said)
        return copy(*values, **named)

    monkeypatch.setattr(copies, "_copy", meanwhile)
    backup(own, tmp_path / "copy")
    assert refused
    restore(tmp_path / "copy", tmp_path / "again")
    backup(own, tmp_path / "copy")


def test_two_restores_of_one_store_at_once(own: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    backup(own, tmp_path / "copy")
    copy, refused = copies._copy, []

    def meanwhile(*values: Any, **named: Any) -> Any:
        found = copy(*values, **named)
        if not refused:
            with pytest.raises(ReadOnlyStore, match="another command") as said:
                restore(tmp_path / "copy", tmp_path / "again")
            refused.append(said)
        return found

    monkeypatch.setattr(copies, "_copy", meanwhile)
    restore(tmp_path / "copy", tmp_path / "again")
    assert refused
    assert len(list(Store.open(tmp_path / "again").results())) == 2


def test_of_a_restore_that_finds_no_room_nothing_stays(
    own: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    backup(own, tmp_path / "copy")
    write, written = Path.write_bytes, []

    def full(self: Path, data: Any) -> int:
        written.append(self)
        if len(written) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(self, data)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(StorageFull):
            restore(tmp_path / "copy", tmp_path / "again")
    assert len(written) == 3
    assert {path.name for path in tmp_path.iterdir()} == {"copy", "store"}
    restore(tmp_path / "copy", tmp_path / "again")


BACKUP = """
import resource, signal, sys
from pathlib import Path
from store.copies.backup import backup
from store.errors import StoreError
from store.store import Store
store = Store.open(Path(sys.argv[1]))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
try:
    backup(store, Path(sys.argv[2]))
except StoreError as error:
    print(error.code, error.message)
"""


def test_a_store_on_a_full_disk_says_so_and_not_that_its_ledger_is_broken(own: Store, tmp_path: Path) -> None:
    """SQLite makes files beside a ledger to read it, and calls it an I/O error if it cannot."""
    backup(own, tmp_path / "copy")
    restore(tmp_path / "copy", tmp_path / "closed")  # nobody has it open
    said = python(BACKUP, tmp_path / "closed", tmp_path / "another").communicate(timeout=120)[0]
    assert said.startswith("storage-full")
    assert str(tmp_path / "closed" / "ledger.sqlite") in said


def test_a_store_is_restored_where_one_stands_and_behind_a_link(
    own: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    backup(own, tmp_path / "copy")
    for place in ("here", "there"):
        (tmp_path / place).mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there")
    monkeypatch.chdir(tmp_path / "here")
    restore(Path("../copy"), Path())
    restore(Path("../copy"), Path("../link"))
    for place in ("here", "there", "link"):
        assert len(list(Store.open(tmp_path / place).results())) == 2
    assert (tmp_path / "link").is_symlink()


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[100] ^= 1
    path.write_bytes(data)


def test_another_backup_repairs_what_was_damaged(own: Store, tmp_path: Path) -> None:
    backup(own, tmp_path / "copy")
    first, second = sorted((tmp_path / "copy").glob("shards/*/*.h5"))
    flip(first)
    second.unlink()
    assert backup(own, tmp_path / "copy").new == 2 + 3  # and what changes
    restore(tmp_path / "copy", tmp_path / "again")
    assert len(list(Store.open(tmp_path / "again").results())) == 2


def test_a_result_that_was_healed_since_replaces_its_damaged_copy(own: Store, tmp_path: Path) -> None:
    """And a sound copy is not given up for a result that is damaged now."""
    key, result = make(te=0.03, resolution=8)
    flip(own.shard_path(key))
    backup(own, tmp_path / "copy")
    own.put(key, result)
    backup(own, tmp_path / "copy")
    for damage in (flip, lambda path: path.write_bytes(path.read_bytes()[:200])):
        damage(own.shard_path(key))
        backup(own, tmp_path / "copy")
    restore(tmp_path / "copy", tmp_path / "again")
    assert Store(tmp_path / "again").get(key).attrs["digest"] == shards.digest(result)


def test_what_was_damaged_already_is_named(own: Store, tmp_path: Path) -> None:
    damaged, sound = sorted(own.root.glob("shards/*/*.h5"))
    flip(damaged)
    flip(tables.path_of(own, tables.info(own)))
    names = tuple(path.relative_to(own.root).as_posix() for path in (damaged, tables.path_of(own, tables.info(own))))
    copied = backup(own, tmp_path / "copy")
    assert copied.damaged == names
    assert (copied.kept, copied.gone) == ((), ())
    restore(tmp_path / "copy", tmp_path / "again")
    assert list(Store.open(tmp_path / "again").results()), f"{sound} is as good as before"


def test_what_a_store_lost_stays_in_its_backup(own: Store, tmp_path: Path) -> None:
    """Deleted by mistake, and the nightly backup goes on: the ledger still calls it done."""
    first = backup(own, tmp_path / "copy")
    generation = tables.path_of(own, tables.info(own))
    generation.unlink()
    keys = list(own.keys())
    shutil.rmtree(own.root / "shards")
    (own.root / "shards").mkdir()
    second = backup(own, tmp_path / "copy")
    assert second.files == first.files
    lost = [generation, *map(own.shard_path, keys)]
    assert sorted(second.kept) == sorted(path.relative_to(own.root).as_posix() for path in lost)
    assert backup(own, tmp_path / "copy").files == first.files, "night after night"
    restore(tmp_path / "copy", tmp_path / "again")
    again = Store.open(tmp_path / "again")
    assert [result.attrs["key"] for result in again.results()] == keys
    tables.open(again).close()
    flip(tmp_path / "copy" / own.shard_path(keys[0]).relative_to(own.root))
    third = backup(own, tmp_path / "copy")
    assert len(third.kept) == 2
    assert third.gone == (keys[0],), "neither has it any more"
    own.ledger.rebuild(own.results())
    assert backup(own, tmp_path / "copy").gone == (), "what waits again is not done"


def test_a_store_in_which_nothing_changes(tmp_path: Path) -> None:
    """Neither ledger nor tables nor tokens."""
    store = Store.open(tmp_path / "store", create=True)
    key, result = make(te=0.03, resolution=8)
    store.put(key, result)
    assert backup(store, tmp_path / "copy").files == 1
    restore(tmp_path / "copy", tmp_path / "again")
    assert list(Store.open(tmp_path / "again").keys()) == [key]


@pytest.mark.parametrize("damage", ['{"a":', "[]", '{"file": "x.h5"}', "gone"])
def test_one_damaged_table_stops_no_backup(own: Store, tmp_path: Path, damage: str) -> None:
    tables.build(own, SOLVER, "other")
    if damage == "gone":
        tables.path_of(own, tables.info(own)).unlink()
    else:
        (own.tables_dir / "default" / "current.json").write_text(damage)
    backup(own, tmp_path / "copy")
    restore(tmp_path / "copy", tmp_path / "again")
    again = Store.open(tmp_path / "again")
    tables.open(again, "other").close()
    with pytest.raises((CorruptTable, FileNotFoundError)):
        tables.open(again)


def test_a_generation_that_is_pruned_meanwhile_is_missed(
    own: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = copies._copy

    def meanwhile(source: Path, *values: Any, **named: Any) -> Any:
        found = copy(source, *values, **named)
        if source.name == "current.json":
            tables.rebuild(own, SOLVER, dtype="float64")
            tables.prune(own)
        return found

    with monkeypatch.context() as patch:
        patch.setattr(copies, "_copy", meanwhile)
        with pytest.raises(CorruptBackup, match="went away"):
            backup(own, tmp_path / "copy")
    backup(own, tmp_path / "copy")
