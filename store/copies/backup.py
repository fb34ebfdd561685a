"""A store copied while it is in use, and brought back.

A backup is a directory with results and generations of tables as a store has them, what changes (ledger, manifests,
plans, tokens) in a folder of its own for each copy, and a list of all files with their SHA-256 (`backup.json`). Results
are immutable, so a later backup into the same directory copies only what is new, and anew what is not sound there. The
list is written last: whatever is killed on the way, the backup before is still whole.

The ledger is copied first, as SQLite sees it at one moment: what it calls done has its shard on the disk by then. What
it calls done and the store has lost since stays in the backup, where that has it. A restored store appears at once, by
a rename.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import shutil
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from solver import __version__

from .. import holding, seal
from ..errors import CorruptBackup, CorruptLedger, CorruptTable, MissingStore, ReadOnlyStore, UnknownTable, full_disk
from ..ledger.database import ask_the_system, readable
from ..manifest import read_manifest
from ..store import Store

__all__ = ["Copied", "backup", "restore"]

_LIST = "backup.json"
_LEDGER = "ledger.sqlite"
_CHANGING = "changing"
#: What a store is made of, besides its ledger. Quarantined stages and the marks of running jobs stay behind.
_CHANGES = ("tables/*/scalars.nc", "tables/*/current.json", "plans/*.toml", "tokens.json")
_STAYS = ("shards/??/*.h5", "tables/*/*.h5")
_PRIVATE = ("tokens.json",)
_SEALED = (".h5", ".nc")
#: A claim means nothing after a restore: its worker belongs to the other store.
_FREE = "UPDATE jobs SET state = 'wanted', worker = NULL, lease_until = NULL, progress = 0 WHERE state = 'running'"


class Copied(NamedTuple):
    """What a copy holds, and what of it had to be copied.

    `damaged` are files that were damaged already when they were copied, `kept` those that the store has lost and the
    backup before still had, `gone` the keys of results that the ledger calls done and nobody has.
    """

    files: int
    bytes: int
    new: int
    created: str
    damaged: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()


def backup(store: Store, to: Path) -> Copied:
    """Copy a store into the directory `to`, which an earlier backup of it may hold already.

    Raises:
        ReadOnlyStore: `to` holds something else, may not be written, or another backup is written into it.
        StorageFull: there is no room; the backup before stays whole.

    """
    if to.resolve() == store.root.resolve() or (to.is_dir() and not (to / _LIST).exists() and _is_foreign(to)):
        raise ReadOnlyStore(f"{to} holds something else than a backup.", "Name an empty or a new directory.")
    with full_disk(to), _alone(to):
        known = _listed(to)["files"] if (to / _LIST).exists() else {}
        for place in (to, to / "shards", to / "tables"):
            seal.clean(place)
        now = datetime.now(UTC)
        changing = f"{_CHANGING}/{now:%Y%m%dT%H%M%S}-{secrets.token_hex(4)}"
        seal.make_directory(to / changing)  # of a store in which nothing changes it stays empty
        files, done = {}, list[str]()
        if store.ledger.path.is_file():
            files[_LEDGER], done = _copy_ledger(store, to, f"{changing}/{_LEDGER}")
        new, damaged = 0, list[str]()
        # what changes first, then what there is by now: the generation that a manifest names is among it
        for patterns in (_CHANGES, _STAYS):
            for name in sorted(_names(store.root, patterns)):
                at = name if patterns is _STAYS else f"{changing}/{name}"
                files[name], copied = _copy(store.root / name, to, at, known.get(name), private=name in _PRIVATE)
                new += copied
                if copied and at.endswith(_SEALED) and not seal.is_whole(to / at):
                    damaged.append(name)
        kept = {name: known[name] for name in _lost(to / changing, files, done) if _has(to, known.get(name))}
        files |= kept
        _check_tables(store.root, to / changing, files)
        page: dict[str, Any] = {"wizen": __version__, "created": now.isoformat(timespec="seconds"), "files": files}
        seal.publish(to / _LIST, json.dumps(page, indent=1).encode())
        for old in (to / _CHANGING).iterdir():
            if old.name != Path(changing).name:
                shutil.rmtree(old)
    gone = tuple(key for key in done if _shard(key) not in files)
    size = sum(entry["bytes"] for entry in files.values())
    return Copied(len(files), size, new, page["created"], tuple(damaged), tuple(kept), gone)


def restore(source: Path, root: Path) -> Copied:
    """Make a store in `root`, where none is, of the backup in `source`, once every byte of it was found as written.

    Raises:
        MissingStore: `source` is no backup.
        CorruptBackup: a file of it is missing or changed.
        ReadOnlyStore: there is something in `root` already, it may not be written, or somebody else restores it.
        StorageFull: there is no room; nothing stays.

    """
    if not (source / _LIST).is_file():
        raise MissingStore(f"there is no backup in {source}.", "`wizen backup DIR --store STORE` makes one.")
    root = root.resolve()  # `.` has no name, and the place of a link is not the link's
    _check_empty(root)
    page = _listed(source)
    growing = root.with_name(f".{root.name}.restoring")
    with full_disk(root), _alone(growing):
        try:
            _empty(growing)  # of a restore that was killed
            _grow(source, page["files"], growing)
            _check_empty(root)  # it may have been restored meanwhile
            if root.exists():
                root.rmdir()
            growing.rename(root)
        except BaseException:
            shutil.rmtree(growing, ignore_errors=True)
            raise
        seal.sync(root.parent)
    sizes = [entry["bytes"] for entry in page["files"].values()]
    return Copied(len(sizes), sum(sizes), len(sizes), page["created"])


@contextmanager
def _alone(directory: Path) -> Iterator[None]:
    """Make a directory, and write into it alone.

    Raises:
        ReadOnlyStore: another command does.

    """
    seal.make_directory(directory)
    with holding.alone(directory) as is_ours:
        if not is_ours:
            raise ReadOnlyStore(f"another command is writing into {directory}.", "Wait until it has ended.")
        yield


def _check_empty(root: Path) -> None:
    if root.exists() and (not root.is_dir() or any(root.iterdir())):
        raise ReadOnlyStore(f"{root} is not empty.", "Restore into a new directory; then put it in its place.")


def _empty(directory: Path) -> None:
    for path in directory.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _grow(source: Path, files: Mapping[str, Any], growing: Path) -> None:
    """Copy what a backup lists into a directory that becomes a store.

    Raises:
        CorruptBackup: a file is missing or changed.

    """
    for name, entry in files.items():
        found, _ = _copy(source / entry["at"], growing, name, None, private=name in _PRIVATE)
        if found["sha256"] != entry["sha256"]:
            raise CorruptBackup(f"{source / entry['at']} is not what was copied.", "Take another backup.")
    for name in ("shards", "tables"):
        seal.make_directory(growing / name)


def _is_foreign(to: Path) -> bool:
    """Return whether a directory holds what no interrupted backup would have left."""
    ours = {"shards", "tables", _CHANGING}
    return any(path.name not in ours and not path.name.startswith(f".{_LIST}") for path in to.iterdir())


def _listed(source: Path) -> dict[str, Any]:
    """Return what a backup says of itself.

    Raises:
        CorruptBackup: it cannot be read, or names files outside of it.

    """
    try:
        page: dict[str, Any] = json.loads((source / _LIST).read_bytes())
        names = [*page["files"]]
        if not isinstance(page["created"], str) or any(
            name.startswith("/") or ".." in Path(name).parts for name in names
        ):
            raise ValueError("it names files outside of it")
        return page
    except (ValueError, KeyError, TypeError) as error:
        raise CorruptBackup(f"{source / _LIST} is damaged ({error}).", "Take another backup.") from error


def _shard(key: str) -> str:
    return f"shards/{key[:2]}/{key}.h5"


def _lost(changing: Path, files: Mapping[str, Any], done: Sequence[str]) -> Iterator[str]:
    """Yield the results that a copied ledger calls done, and current generations of tables, that were not copied."""
    for page in changing.glob("tables/*/current.json"):
        with suppress(CorruptTable, UnknownTable):
            name = f"tables/{page.parent.name}/{read_manifest(changing / 'tables', page.parent.name).file}"
            if name not in files:
                yield name
    for key in done:
        if _shard(key) not in files:
            yield _shard(key)


def _has(to: Path, known: Mapping[str, Any] | None) -> bool:
    """Return whether a backup holds what its list before said of a file."""
    return known is not None and _is_sound(to / known["at"], known)


def _check_tables(root: Path, changing: Path, files: Mapping[str, Any]) -> None:
    """Refuse a copy in whose making a generation was pruned; a table that is damaged in the store is so in the copy.

    Raises:
        CorruptBackup: it was.

    """
    for page in changing.glob("tables/*/current.json"):
        table = page.parent.name
        try:
            name = f"tables/{table}/{read_manifest(changing / 'tables', table).file}"
        except (CorruptTable, UnknownTable):
            continue
        if name not in files and not _is_still(page, root / "tables" / table / page.name):
            raise CorruptBackup(f"{name} went away while it was copied.", "Copy again.")


def _is_still(copied: Path, source: Path) -> bool:
    try:
        return copied.read_bytes() == source.read_bytes()
    except FileNotFoundError:
        return False


def _names(root: Path, patterns: Sequence[str]) -> Iterator[str]:
    for pattern in patterns:
        for path in root.glob(pattern):
            if path.is_file():
                yield path.relative_to(root).as_posix()


def _copy(
    source: Path, root: Path, at: str, known: dict[str, Any] | None, private: bool
) -> tuple[dict[str, Any], bool]:
    """Copy a file to `at` below `root` unless it is there; return what is listed of it, and whether it was copied.

    Only results and generations are taken for what they were: they never change.
    """
    to = root / at
    try:
        if known is not None and at.endswith(".h5") and _is_sound(to, known) and _is_no_better(source, known):
            return known, False
        data = source.read_bytes()
    except FileNotFoundError:
        raise CorruptBackup(f"{source} is missing.", "Copy again, or take another backup.") from None
    with seal.scratch(to, private) as temporary:
        temporary.write_bytes(data)
        seal.adopt(temporary, to)
    return {"at": at, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}, True


def _is_sound(copied: Path, known: Mapping[str, Any]) -> bool:
    """Return whether a sealed file in a backup is what was copied, and was whole when it was."""
    if not copied.is_file() or copied.stat().st_size != known["bytes"]:
        return False
    with copied.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() == known["sha256"] and seal.is_whole(copied)


def _is_no_better(source: Path, known: Mapping[str, Any]) -> bool:
    """Return whether a sound copy need not be made again: what has another size is another file, or was cut short."""
    return source.stat().st_size == known["bytes"] or not seal.is_whole(source)


def _copy_ledger(store: Store, root: Path, at: str) -> tuple[dict[str, Any], list[str]]:
    """Copy the ledger as it is at one moment, with no job claimed; return what is listed of it, and what it calls done.

    Raises:
        CorruptLedger: it cannot be read.
        StorageFull, StorageFailed: the store's own disk is full or broken; to be read it takes some kB there.

    """
    path = store.ledger.path
    # in memory first: SQLite's locks would wait for ours on the file
    try:
        with closing(sqlite3.connect(readable(path), uri=True)) as source, closing(sqlite3.connect(":memory:")) as copy:
            source.backup(copy)
            copy.execute(_FREE)
            copy.commit()
            done = [str(key) for (key,) in copy.execute("SELECT key FROM jobs WHERE state = 'done' ORDER BY key")]
            data = copy.serialize()
    except sqlite3.DatabaseError as error:
        if getattr(error, "sqlite_errorname", "").startswith(("SQLITE_FULL", "SQLITE_IOERR")):
            ask_the_system(path)
        advice = "`wizen doctor` says what is wrong with it. Who may not write there cannot read it while it is in use."
        raise CorruptLedger(f"{path} cannot be read ({error}).", advice) from error
    seal.publish(root / at, data)
    return {"at": at, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}, done
