"""Holding a file: the system knows whose it is, and forgets it when its holder dies, however that happens.

Locks of open file descriptions (Linux), which belong to neither a process nor a thread: libraries that open and close
the file meanwhile, and locks of theirs (HDF5 takes `flock`'s), do not disturb them.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["alone", "hold", "remove_free"]

#: struct flock on 64-bit Linux: type, whence, start, length (0: to the end), process id, which must be 0.
_WHOLE = struct.pack("hhqqi0q", fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)
_NONE = struct.pack("hhqqi0q", fcntl.F_UNLCK, os.SEEK_SET, 0, 0, 0)
_KNOWN = hasattr(fcntl, "F_OFD_SETLK")


def hold(handle: int) -> bool:
    """Hold an open file until its handle is closed; return whether its file system can tell."""
    if not _KNOWN:
        return False
    try:
        fcntl.fcntl(handle, fcntl.F_OFD_SETLKW, _WHOLE)
    except OSError:
        return False
    if _is_alone(handle):
        return True
    # network file systems make one lock of both kinds: ours would shut out HDF5's
    fcntl.fcntl(handle, fcntl.F_OFD_SETLK, _NONE)
    return False


@contextmanager
def alone(directory: Path) -> Iterator[bool]:
    """Hold a directory; yields whether nobody else holds it, as far as its file system can tell."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield _is_only_holder(handle, directory)
    finally:
        os.close(handle)


def _is_only_holder(handle: int, directory: Path) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # some network file systems lock no directories
    try:
        # whoever held it before may have given it another name
        return os.path.samestat(os.fstat(handle), directory.stat())
    except FileNotFoundError:
        return False


def _is_alone(handle: int) -> bool:
    """Return whether locks of the other kind do not see ours."""
    try:
        other = os.open(f"/proc/self/fd/{handle}", os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return True
    try:
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(other)
    return True


def remove_free(path: Path, otherwise: bool) -> bool:
    """Remove the file `path` if nobody holds it, and return whether that was so; `otherwise` where nobody can tell.

    Raises:
        OSError: it cannot be opened or removed.

    """
    handle = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        free = _is_free(handle, otherwise)
        if free:
            path.unlink()  # still held by us: whoever begins to hold it meanwhile finds it gone
    finally:
        os.close(handle)
    return free


def _is_free(handle: int, otherwise: bool) -> bool:
    if not _KNOWN:
        return otherwise
    try:
        fcntl.fcntl(handle, fcntl.F_OFD_SETLK, _WHOLE)
    except OSError as error:
        # where there are no such locks, nobody holds anything in this way
        return error.errno not in (errno.EAGAIN, errno.EACCES) and otherwise
    return _is_alone(handle) or otherwise
