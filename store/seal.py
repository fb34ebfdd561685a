"""Files that appear whole or not at all, and that know when a byte of them has changed.

HDF5's Fletcher32 guards chunks of values, not the tree that leads to them, and a damaged tree can crash the library.
So every file ends in a seal: eight letters and the SHA-256 of all bytes before. HDF5 ignores bytes after its end, so
a sealed file still opens everywhere, and it is checked before HDF5 sees it.
"""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from . import holding
from .errors import ReadOnlyStore, full_disk

__all__ = ["TRAILER", "adopt", "body", "clean", "is_whole", "make_directory", "publish", "scratch", "seal", "sync"]

_MARK = b"wizen\x00\x01\n"
#: Bytes of the seal at the end of a file.
TRAILER = len(_MARK) + hashlib.sha256().digest_size

_TEMPORARY = ".part"
#: Seconds after which a temporary file belongs to nobody.
_ABANDONED = 3600.0


def make_directory(path: Path) -> None:
    """Make a directory and those above it; what is new is on the disk, name and all, when this returns.

    Raises:
        ReadOnlyStore: there is a file in its place, or in that of one above it.

    """
    if path.is_dir():
        return
    make_directory(path.parent)
    try:
        path.mkdir(exist_ok=True)
    except FileExistsError:
        raise ReadOnlyStore(f"{path} is no directory.", "Name another one, or move away what is there.") from None
    sync(path.parent)


@contextmanager
def scratch(path: Path, private: bool = False) -> Iterator[Path]:
    """Yield an empty temporary file beside `path`, and remove it on leaving unless `adopt` took it.

    It is held meanwhile, so that `clean` knows whose writer is alive. `private`: nobody else may ever read it.

    Raises:
        StorageFull: the disk is full.

    """
    with full_disk(path):
        make_directory(path.parent)
        temporary, handle = _begin(path, 0o600 if private else 0o666)
        try:
            yield temporary
        finally:
            temporary.unlink(missing_ok=True)
            os.close(handle)


def _begin(path: Path, mode: int) -> tuple[Path, int]:
    """Make a temporary file that we hold; return its name and the handle that holds it."""
    while True:
        temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}{_TEMPORARY}")
        handle = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        holding.hold(handle)
        if os.fstat(handle).st_nlink:
            return temporary, handle
        os.close(handle)  # somebody cleaned up between the two lines above


def adopt(temporary: Path, path: Path) -> None:
    """Make a file written under a temporary name visible as `path`, whole and on the disk when this returns."""
    sync(temporary)
    temporary.replace(path)
    sync(path.parent)


def publish(path: Path, data: bytes | memoryview) -> None:
    """Write `data` to `path` so that it survives a crash, and never shows half of it.

    Raises:
        StorageFull: the disk is full.

    """
    with scratch(path) as temporary:
        temporary.write_bytes(data)
        adopt(temporary, path)


def seal(path: Path) -> None:
    """Append the seal to the file `path`."""
    with path.open("r+b") as file:
        digest = hashlib.file_digest(file, "sha256").digest()
        file.seek(0, os.SEEK_END)
        file.write(_MARK + digest)


def is_whole(path: Path) -> bool:
    """Return whether a sealed file is as it was written, without holding it in memory."""
    left = path.stat().st_size - TRAILER
    if left < 0:
        return False
    digest = hashlib.sha256()
    block = memoryview(bytearray(1 << 20))
    with path.open("rb") as file:
        while left > 0:
            got = file.readinto(block[: min(left, len(block))])
            if not got:
                return False
            digest.update(block[:got])
            left -= got
        return file.read(TRAILER) == _MARK + digest.digest()


def body(data: bytes) -> bytes | None:
    """Return a sealed file's content without its seal, or None if the seal is broken or missing."""
    content = data[:-TRAILER]
    return content if data[-TRAILER:] == _MARK + hashlib.sha256(content).digest() else None


def clean(directory: Path) -> int:
    """Remove temporary files that a killed process left in `directory` or one level below; return how many.

    Where the file system cannot say who holds a file, only those an hour old are taken for left.
    """
    removed = 0
    for pattern in (f".*{_TEMPORARY}", f"*/.*{_TEMPORARY}"):
        for path in directory.glob(pattern):
            try:
                removed += holding.remove_free(path, time.time() - path.stat().st_mtime > _ABANDONED)
            except FileNotFoundError:
                continue  # its writer, or another cleaner, was faster
            except OSError as error:
                if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
                    raise
                # another user's, who cleans up after himself
    return removed


def sync(path: Path) -> None:
    """Return once a file, or the names in a directory, are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
