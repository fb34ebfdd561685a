"""Where a ledger may lie: the kernel's list of mounts is read, and what it says of a path believed."""

from __future__ import annotations

from pathlib import Path

import pytest

from store.errors import NetworkFileSystem
from store.ledger import filesystem as module
from store.ledger.filesystem import filesystem, refuse_network
from store.ledger.ledger import Ledger
from store.store import Store

LINE = "{number} 1 0:{number} / {mount} rw,relatime shared:{number} - {kind} {source} rw\n"


def mounts(path: Path, *pairs: tuple[str, str]) -> Path:
    text = ""
    for number, (mount, kind) in enumerate((("/", "ext4"), *pairs), 1):
        text += LINE.format(number=number, mount=mount.replace(" ", "\\040"), kind=kind, source="there:/export")
    path.write_text(text)
    return path


@pytest.mark.parametrize("kind", ["nfs4", "nfs", "cifs", "smb3", "9p", "fuse", "fuse.sshfs"])
def test_a_ledger_on_a_network_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    root = tmp_path / "far away"
    monkeypatch.setattr(module, "_MOUNTS", mounts(tmp_path / "mounts", (str(root), kind)))
    with pytest.raises(NetworkFileSystem, match=f"lies on {kind}, mounted at .*far away.*--scheduler"):
        Ledger(root / "store" / "ledger.sqlite").counts()
    assert not root.exists()  # refused before anything is written
    refuse_network(tmp_path / "far")  # another folder, whose name begins alike


def test_the_innermost_and_last_mount_decides(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inner = tmp_path / "far" / "scratch"
    pairs = ((str(tmp_path / "far"), "nfs4"), (str(inner), "fuse"), (str(inner), "xfs"))
    monkeypatch.setattr(module, "_MOUNTS", mounts(tmp_path / "mounts", *pairs))
    assert filesystem(inner / "store") == ("xfs", inner)
    assert filesystem(tmp_path / "far" / "else") == ("nfs4", tmp_path / "far")
    (tmp_path / "link").symlink_to(tmp_path / "far" / "else")
    with pytest.raises(NetworkFileSystem):
        refuse_network(tmp_path / "link" / "store")


@pytest.mark.skipif(not module._MOUNTS.exists(), reason="only Linux lists its mounts so")
def test_the_real_list_is_read(tmp_path: Path) -> None:
    found = filesystem(tmp_path)
    assert found is not None
    assert found[1].stat().st_dev == tmp_path.stat().st_dev
    assert Store.open(tmp_path / "store", create=True).ledger.counts() is not None


def test_without_a_list_nothing_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MOUNTS", tmp_path / "none")
    assert filesystem(tmp_path) is None
    refuse_network(tmp_path)
