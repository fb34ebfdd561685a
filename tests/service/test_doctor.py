"""What the doctor says of things that are wrong for real: a taken port, a broken ledger, a flipped byte."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import socket
import sqlite3
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli import app
from service.commands import doctor
from service.commands.doctor import Finding, examine
from service.settings import Settings
from solver import registry
from store import tables
from store.ledger.filesystem import filesystem
from store.store import Store

from .conftest import client_of


@pytest.fixture
def port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


def found(root: Path, port: int, deep: bool = False, **settings: object) -> dict[str, Finding]:
    return {f.what: f for f in examine(Settings(store=root, port=port, **settings), deep)}  # type: ignore[arg-type]


def test_a_sound_store_is_found_sound(own: Store, port: int) -> None:
    seen = found(own.root, port, deep=True)
    assert not [f for f in seen.values() if f.state == "bad"]
    assert seen["ledger"].seen.endswith(" done")
    assert seen["bytes"].state == seen["tables"].state == seen["writing"].state == "good"
    assert f"port {port} is free" in seen["port"].seen
    done = CliRunner().invoke(app, ["doctor", "--store", str(own.root), "--port", str(port)])
    assert done.exit_code == 0, done.output
    assert "ok    ledger" in done.output
    assert {path.name for path in own.root.iterdir()} == {"shards", "tables", "ledger.sqlite"} | {
        path.name for path in own.root.glob("ledger.sqlite-*")
    }


def test_a_table_that_came_without_its_runs_is_noted(own: Store, port: int) -> None:
    for key in list(own.keys()):
        own.shard_path(key).unlink()
    seen = found(own.root, port, deep=True)["bytes"]
    assert (seen.state, seen.advice) == ("note", "")
    assert "None of the table's runs is here" in seen.seen


@pytest.mark.parametrize(("answered", "state", "word"), [(True, "note", "served"), (False, "bad", "stale")])
def test_a_table_of_another_version_is_served_or_stale(
    own: Store, port: int, monkeypatch: pytest.MonkeyPatch, answered: bool, state: str, word: str
) -> None:
    solver = registry.get(tables.info(own, own.table_names()[0]).solver)
    later = dataclasses.replace(solver, version="99", tables_of=(solver.version,) if answered else ())
    monkeypatch.setattr(registry, "get", lambda name: later)
    seen = found(own.root, port)["tables"]
    assert (seen.state, word in seen.advice, "sweep its plan" in seen.advice) == (state, True, True)


def test_a_port_that_another_has_is_told_from_our_own(own: Store) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = other.getsockname()[1]
        seen = found(own.root, taken)["port"]
        assert (seen.state, "--port 0" in seen.advice) == ("bad", True)
        done = CliRunner().invoke(app, ["doctor", "--store", str(own.root), "--port", str(taken), "--json"])
        assert done.exit_code == 1
    with client_of(own.root) as client:
        seen = found(own.root, int(client.base_url.port or 0))["port"]
        assert seen.state == "good"
        assert "a wizen service answers" in seen.seen


def test_a_broken_ledger_and_a_flipped_byte(own: Store, port: int) -> None:
    own.ledger.close()
    (own.root / "ledger.sqlite").write_bytes(b"no database" * 999)
    seen = found(own.root, port)
    assert seen["ledger"].state == "bad"
    assert "wizen sweep" in seen["ledger"].advice
    path = tables.path_of(own, tables.info(own))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert "bytes" not in seen
    for _ in range(2):
        assert found(own.root, port, deep=True)["bytes"].state == "bad"
        for name in ("ledger.sqlite", "ledger.sqlite-wal", "ledger.sqlite-shm"):
            (own.root / name).unlink(missing_ok=True)  # as advised


def test_a_damaged_result_that_no_table_holds_is_found(own: Store, port: int) -> None:
    assert found(own.root, port, deep=True)["results"].state == "good"
    for path in own.tables_dir.iterdir():
        shutil.rmtree(path)
    path = own.shard_path(next(own.keys()))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert "results" not in found(own.root, port)
    seen = found(own.root, port, deep=True)["results"]
    assert (seen.state, str(path) in seen.seen, "Delete the file" in seen.advice) == ("bad", True, True)
    path.unlink()
    seen = found(own.root, port)["ledger"]
    assert (seen.state, "results of 1 that are done are not here" in seen.seen) == ("note", True)


def test_a_table_whose_solver_is_gone_is_said(own: Store, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "names", lambda: ["wood"])
    seen = found(own.root, port)["tables"]
    assert (seen.state, "not installed" in seen.advice) == ("bad", True)


def test_a_ledger_of_a_later_wizen_is_bad_and_not_to_be_deleted(own: Store, port: int) -> None:
    """All other commands refuse it."""
    own.ledger.close()
    with contextlib.closing(sqlite3.connect(own.ledger.path)) as connection:
        connection.execute("PRAGMA user_version = 99")
    seen = found(own.root, port)["ledger"]
    assert (seen.state, "version 99" in seen.seen) == ("bad", True)
    assert "Delete" not in seen.advice


@pytest.mark.parametrize("name", ["a#b", "50%25", "what?mode=rwc"])
def test_a_sound_ledger_of_any_name_is_sound(own: Store, port: int, tmp_path: Path, name: str) -> None:
    own.ledger.close()
    root = own.root.rename(tmp_path / name)
    seen = found(root, port)["ledger"]
    assert (seen.state, seen.seen) == ("good", "4 done")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_ledger_that_this_user_cannot_open_is_not_said_to_be_broken(
    own: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite reads a file in use only where its side files may be written."""

    def connect(*values: object, **named: object) -> None:
        error = sqlite3.OperationalError("unable to open database file")
        error.sqlite_errorname = "SQLITE_CANTOPEN"
        raise error

    monkeypatch.setattr(sqlite3, "connect", connect)
    seen = doctor._ledger(own.root)
    assert (seen.state, "Delete" in seen.advice) == ("bad", False)


def test_no_store_no_table_no_room(tmp_path: Path, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    none = found(tmp_path / "none", port)
    assert (none["store"].state, "ledger" in none) == ("note", False)
    root = Store.open(tmp_path / "new", create=True).root
    assert "table build" in found(root, port)["tables"].advice
    monkeypatch.setattr(doctor, "_ROOM", 1e30)
    assert "Make room" in found(root, port)["disk"].advice


def test_a_network_file_system_is_bad(own: Store, port: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from store.ledger import filesystem as module

    text = f"1 1 0:1 / / rw - ext4 a rw\n2 1 0:2 / {own.root} rw - nfs4 b rw\n"
    (tmp_path / "mounts").write_text(text)
    monkeypatch.setattr(module, "_MOUNTS", tmp_path / "mounts")
    assert filesystem(own.root) == ("nfs4", own.root)
    seen = found(own.root, port)
    assert seen["file system"].state == "bad"
    assert "ledger" not in seen


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="the one directory that not even root may write into")
def test_a_store_that_may_not_be_written_is_noted(port: int) -> None:
    seen = found(Path("/proc"), port)["writing"]
    assert seen.state == "note"
    assert "--store DIR" in seen.advice


def test_a_wrong_setting_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WIZEN_THREADS", "many")
    done = CliRunner().invoke(app, ["doctor"])
    assert done.exit_code == 2
    assert "WIZEN_THREADS" in done.output
