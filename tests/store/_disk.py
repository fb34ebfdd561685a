"""A disk whose power may be cut: records writes, fsyncs and renames below a directory, and gives what may be left.

What POSIX promises is little. The content of a file is on the disk from its fsync on; until then any older content,
nothing, or a part of it may be there. The names in a directory are on the disk from the directory's fsync on; until
then each making, renaming and removing of a name may or may not have happened, in any order.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

#: Names below the root, with the content of files; None for directories.
Tree = dict[Path, bytes | None]


@dataclass
class _Node:
    """A file or a directory: what is safe on the disk, and what has been done to it since."""

    is_directory: bool
    #: of a file: its contents; of a directory: (name, node or None) for each name set or removed, a rename being one
    safe: Any = None
    since: list[Any] = field(default_factory=list)

    @property
    def now(self) -> bytes:
        return self.since[-1] if self.since else self.safe


class Disk:
    """The model: `log` says what was done, `cuts` what may be left if the power fails now.

    The ledger is left out: SQLite writes and syncs it past these functions, and it can be rebuilt.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.log: list[tuple[str, str]] = []
        self._nodes: dict[int, _Node] = {}
        self._top = self._seen(root)

    def _seen(self, path: Path) -> _Node:
        """Take what is there for safe."""
        node = self._nodes[path.stat().st_ino] = _Node(path.is_dir())
        if path.is_dir():
            node.safe = {child.name: self._seen(child) for child in _children(path)}
        else:
            node.safe = path.read_bytes()
        return node

    def _of(self, path: Path) -> _Node | None:
        return self._nodes.get(path.stat().st_ino) if path.exists() else None

    def look(self) -> None:
        """Find what was written, made and removed since the last look: names first, as files appear empty."""
        self._look(self.root)

    def _look(self, directory: Path) -> None:
        parent = self._of(directory)
        assert parent is not None
        names = self._names(parent)
        for path in (there := _children(directory)):
            node = self._of(path)
            if node is None:
                node = self._nodes[path.stat().st_ino] = _Node(path.is_dir(), {} if path.is_dir() else b"")
            if names.get(path.name) is not node:
                self.log.append(("make", path.name))
                parent.since.append({path.name: node})
            if path.is_dir():
                self._look(path)
            elif (data := path.read_bytes()) != node.now:
                self.log.append(("write", path.name))
                node.since.append(data)
        for name in sorted(set(names) - {path.name for path in there}):
            self.log.append(("remove", name))
            parent.since.append({name: None})

    @staticmethod
    def _names(directory: _Node) -> dict[str, _Node]:
        found = dict(directory.safe)
        for change in directory.since:
            found |= change
        return {name: node for name, node in found.items() if node is not None}

    def synced(self, path: Path) -> None:
        """All of a file, or all names in a directory, are on the disk."""
        node = self._of(path)
        assert node is not None
        self.log.append(("fsync", path.name))
        node.safe, node.since = (self._names(node) if node.is_directory else node.now), []

    def renamed(self, old: Path, new: Path) -> None:
        """Take note of a rename, before it is done: both names change at once or not at all."""
        self.log.append(("rename", new.name))
        source, parent, target = self._of(old), self._of(old.parent), self._of(new.parent)
        assert source is not None
        assert parent is not None
        assert parent is target, "no rename from one directory to another is modelled"
        parent.since.append({old.name: None, new.name: source})

    def cuts(self) -> Iterator[Tree]:
        """Yield what may be below the root after a power cut: names as some changes made them, files whole or torn."""
        yield from self._trees(self._top, Path())

    def _trees(self, node: _Node, at: Path) -> Iterator[Tree]:
        if not node.is_directory:
            yield from ({at: data} for data in _contents(node))
            return
        for done in itertools.product((False, True), repeat=len(node.since)):
            names = dict(node.safe)
            for change in itertools.compress(node.since, done):
                names |= change
            there = [(name, child) for name, child in names.items() if child is not None]
            for parts in itertools.product(*(list(self._trees(child, at / name)) for name, child in there)):
                tree: Tree = {at: None}
                for part in parts:
                    tree |= part
                yield tree


def _children(directory: Path) -> list[Path]:
    return sorted(path for path in directory.iterdir() if not path.name.startswith("ledger.sqlite"))


def _contents(file: _Node) -> list[bytes]:
    """Return what a file may hold: any content since its last fsync, whole, cut short, or with a hole in it."""
    found = {file.safe}
    for data in file.since:
        half = len(data) // 2
        found |= {data, data[:half], data[:half] + bytes(len(data) - half), bytes(half) + data[half:]}
    return sorted(found)


@contextmanager
def recorded(disk: Disk, after: Callable[[], None], forget: bool = False) -> Iterator[None]:
    """Record all that is done below the disk's root, and call `after` whenever something was; the power may fail there.

    `forget`: fsync does nothing, as on a disk that lies.
    """
    real = {name: getattr(os, name) for name in ("fsync", "replace", "rename", "mkdir", "unlink", "open", "close")}
    opened: dict[int, Path] = {}

    def inside(path: Any) -> bool:
        return isinstance(path, str | os.PathLike) and Path(path).is_relative_to(disk.root)

    def watched(name: str) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            ours = inside(args[0])
            if ours:
                disk.look()
            if ours and name in ("replace", "rename"):
                disk.renamed(Path(args[0]), Path(args[1]))
            found = real[name](*args, **kwargs)
            if name == "open" and ours:
                opened[found] = Path(args[0])
            if ours:
                disk.look()
                after()
            return found

        return call

    def close(handle: int) -> None:
        opened.pop(handle, None)
        real["close"](handle)

    def fsync(handle: int) -> None:
        if handle in opened and not forget:
            disk.look()
            disk.synced(opened[handle])
            after()
        real["fsync"](handle)

    with pytest.MonkeyPatch.context() as patch:
        for name in ("replace", "rename", "mkdir", "unlink", "open"):
            patch.setattr(os, name, watched(name))
        patch.setattr(os, "close", close)
        patch.setattr(os, "fsync", fsync)
        yield
        disk.look()
        after()


def lay_down(tree: Tree, root: Path) -> None:
    """Make a directory that holds `tree`."""
    for path, data in sorted(tree.items()):
        if data is None:
            (root / path).mkdir()
        else:
            (root / path).write_bytes(data)
