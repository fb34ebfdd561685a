"""What commands say of the store that they begin, copy and bring back."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from _command import document, wizen

from store.ledger.queue import Queue
from store.store import Store
from store.tokens import Tokens
from sweeps.planning.plan import Plan
from sweeps.running.place import Place

Write = Callable[..., Path]


def test_a_new_store_is_said_to_be_one(tmp_path: Path) -> None:
    """A name may be mistyped, and a token of a store that nobody serves is none."""
    first, second = (wizen("token", "create", "--store", tmp_path / "demo", "--name", name) for name in "ab")
    assert f"a new store in {tmp_path / 'demo'}" in first.stderr
    assert "a new store" not in second.stderr
    assert second.stdout.startswith("wizen_")
    worked = wizen("work", "--store", tmp_path / "dmeo", "--until-empty")
    assert f"a new store in {tmp_path / 'dmeo'}" in worked.stderr


@pytest.mark.usefixtures("shrinking")
def test_a_plan_that_can_be_read_once_is_kept(tmp_path: Path, write_plan: Write) -> None:
    """As a shell hands on `<(envsubst < plan)`."""
    text = write_plan("[0.02]", "[10]").read_text()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert wizen("sweep", pipe, "--store", tmp_path / "store").exit_code == 0
    writer.join()
    assert Store.open(tmp_path / "store").plan("pipe") == text


def test_a_backup_says_what_is_wrong_with_the_store(table: Path, tmp_path: Path) -> None:
    store = Store.open(shutil.copytree(table, tmp_path / "store"))
    Tokens(store.root).create("leaked", ["run"])
    keys = list(store.keys())
    data = bytearray(store.shard_path(keys[0]).read_bytes())
    data[100] ^= 1
    store.shard_path(keys[0]).write_bytes(data)
    said = wizen("backup", tmp_path / "copy", "--store", store.root, "--json")
    assert said.exit_code == 1
    assert document(said)["damaged"] == [f"shards/{keys[0][:2]}/{keys[0]}.h5"]
    assert "damaged already" in said.stderr
    Tokens(store.root).revoke("leaked")
    for key in keys:
        store.shard_path(key).unlink()
    again = wizen("backup", tmp_path / "copy", "--store", store.root)
    assert again.exit_code == 0
    assert "this one keeps" in again.stderr
    assert f"calls done what neither has: {keys[0]};" in again.stderr
    assert wizen("restore", tmp_path / "copy", "--store", tmp_path / "none").stderr == ""
    assert len(list(Store.open(tmp_path / "none").keys())) == len(keys) - 1


def test_a_restore_says_which_tokens_are_good_again(table: Path, tmp_path: Path) -> None:
    store = shutil.copytree(table, tmp_path / "store")
    Tokens(store).create("leaked", ["run"])
    assert wizen("backup", tmp_path / "copy", "--store", store).exit_code == 0
    Tokens(store).revoke("leaked")
    said = wizen("restore", tmp_path / "copy", "--store", tmp_path / "again").stderr
    assert "are the tokens leaked: revoke again" in said


def test_status_says_whose_runner_is_gone(table: Path, tmp_path: Path) -> None:
    store = Store.open(shutil.copytree(table, tmp_path / "store"))
    jobs = store.ledger.jobs("done")[:3]
    for job in jobs:
        store.shard_path(job.key).unlink()
    store.ledger.rebuild(store.results())
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    for name, lease in ((Place.here().sign(gone.pid), 3600.0), (Place.here().sign(), 3600.0), ("elsewhere", -1.0)):
        assert store.ledger.claim(name, lease, [jobs.pop(0).key]) is not None
    said = document(wizen("status", "--store", store.root, "--json"))["running"]
    assert [one["lost"] for one in said] == [True, False, True]
    assert wizen("status", "--store", store.root).stdout.count("its runner is gone") == 2


@pytest.mark.usefixtures("shrinking")
def test_a_worker_says_what_became_of_jobs(tmp_path: Path, write_plan: Write) -> None:
    store = Store.open(tmp_path / "store", create=True)
    for trouble in ("", "diverges"):
        (job,) = Plan.load(write_plan("[0.03]", "[10]", f'trouble = "{trouble}"')).jobs()
        Queue(store.ledger).ask(job, "somebody")
    said = wizen("work", "--store", store.root, "--until-empty")
    assert said.exit_code == 1
    assert "1 solved, 1 failed" in said.stdout
    assert " solved in " in said.stderr
    assert "it diverged." in said.stderr
    assert wizen("work", "--store", store.root, "--until-empty").exit_code == 0
