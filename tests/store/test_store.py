from __future__ import annotations

import os
import pickle
import time
from pathlib import Path

import pytest
import xarray as xr

from store import holding, seal
from store.errors import CorruptShard, MissingStore, ReadOnlyStore, StoreError, UnknownJob
from store.store import Store

from .conftest import make, python


def test_missing_store(tmp_path: Path) -> None:
    with pytest.raises(MissingStore, match="Run a sweep") as caught:
        Store.open(tmp_path / "nowhere")
    assert caught.value.code == "missing-store"
    assert not (tmp_path / "nowhere").exists()
    again = pickle.loads(pickle.dumps(caught.value))
    assert isinstance(again, StoreError)
    assert str(again) == str(caught.value)


def test_put_and_get(store: Store) -> None:
    name, dataset = make()
    assert not store.has(name)
    digest = store.put(name, dataset)
    assert store.has(name)
    assert list(store.keys()) == [name]
    assert store.shard_path(name) == store.root / "shards" / name[:2] / f"{name}.h5"
    xr.testing.assert_equal(store.get(name), dataset)
    assert store.get(name).attrs["digest"] == digest
    assert list(Store.open(store.root).keys()) == [name]
    assert list(pickle.loads(pickle.dumps(store)).keys()) == [name]


def test_a_good_result_is_kept_and_a_damaged_one_replaced(store: Store) -> None:
    name, dataset = make()
    digest = store.put(name, dataset)
    before = store.shard_path(name).stat()
    assert store.put(name, dataset + 1) == digest
    assert store.shard_path(name).stat().st_mtime_ns == before.st_mtime_ns
    store.shard_path(name).write_bytes(b"\x89HDF rubbish")
    with pytest.raises(CorruptShard):
        store.get(name)
    assert store.put(name, dataset) == digest
    xr.testing.assert_equal(store.get(name), dataset)


def test_a_result_under_a_wrong_name_is_found_out(store: Store) -> None:
    (one, dataset), (other, _) = make(te=0.03), make(te=0.05)
    store.put(one, dataset)
    store.shard_path(other).parent.mkdir(exist_ok=True)
    store.shard_path(one).rename(store.shard_path(other))
    with pytest.raises(CorruptShard, match="another key"):
        store.get(other)


@pytest.mark.parametrize("name", ["", "../../etc/passwd", "A" * 64, "0" * 63, "0" * 64 + "\n"])
def test_names_that_are_no_keys(store: Store, name: str) -> None:
    assert not store.has(name)
    with pytest.raises(UnknownJob):
        store.get(name)


def test_nothing_there(store: Store) -> None:
    with pytest.raises(UnknownJob, match="no result"):
        store.get("0" * 64)
    assert store.table_names() == []


def test_leftovers_are_cleaned_at_once_and_what_is_being_written_stays(store: Store) -> None:
    directory = store.root / "shards" / "ab"
    directory.mkdir()
    left = [directory / ".x.h5.1.aa.part", store.root / ".tokens.json.1.aa.part"]
    for path in left:
        path.touch()
    with seal.scratch(directory / "y.h5") as held:
        held.write_bytes(b"half")  # by another handle, as libraries do
        Store.open(store.root)
        assert held.exists()
        assert not any(path.exists() for path in left)
        seal.adopt(held, directory / "y.h5")
    assert (directory / "y.h5").read_bytes() == b"half"
    assert not list(store.root.rglob("*.part"))


def test_where_nobody_can_say_who_writes_leftovers_must_be_old(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(holding, "_KNOWN", False)
    old, fresh = store.root / ".x.1.aa.part", store.root / ".y.1.aa.part"
    old.touch()
    fresh.touch()
    os.utime(old, (time.time() - 7200,) * 2)
    Store.open(store.root)
    assert fresh.exists()
    assert not old.exists()


KILLED = """
import os, random, signal, sys, time
from store.store import Store
from tests.store.conftest import make, spec

def work(first, report):
    store = Store.open(sys.argv[1])
    for i in range(10**6):
        asked = {"te": 0.02 + 1e-6 * (first + i), "resolution": 8}
        store.ledger.want([spec(**asked)])
        name, dataset = make(**asked)
        claimed = store.ledger.claim("w", 60.0, [name])
        store.ledger.done(claimed, store.put(name, dataset), 0.1)
        os.write(report, name.encode())

store = Store.open(sys.argv[1], create=True)
store.put(*make(resolution=8))
chance = random.Random(5)
for round in range(6):
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        work(1000 * round, writer)
    os.close(writer)
    print(os.read(reader, 64).decode())
    time.sleep(chance.uniform(0.0, 0.15))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while name := os.read(reader, 64):
        print(name.decode())
"""


def test_kill_nine_loses_nothing_that_was_done(tmp_path: Path) -> None:
    process = python(KILLED, tmp_path)
    reported = set(process.communicate(timeout=120)[0].split())
    store = Store.open(tmp_path)
    visible = set(store.keys())
    done = {job.key for job in store.ledger.jobs("done")}
    assert len(reported) >= 6
    assert reported <= done <= visible
    for name in visible:
        assert store.get(name).attrs["key"] == name
    assert store.ledger.rebuild(store.results()) == len(visible)
    assert {job.key for job in store.ledger.jobs("done")} == visible


def test_a_file_where_a_store_should_be(tmp_path: Path) -> None:
    place = tmp_path / "file"
    place.touch()
    for root in (place, place / "below"):
        with pytest.raises(ReadOnlyStore, match="no directory"):
            Store.open(root, create=True)
