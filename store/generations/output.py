"""A file for HDF5 to write to that never says no: the library may crash once the system has refused it a write.

What the system said is kept instead, and raised where nothing of HDF5 is under way. The file is to be thrown away then,
so it does not matter what else the library believes to have written.
"""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Self

__all__ = ["Output"]


class Output(io.RawIOBase):
    """A file that is read and written in pieces; `check` raises what went wrong first."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("r+b", buffering=0)
        self._failure: OSError | None = None

    def __enter__(self) -> Self:
        return self

    def check(self) -> None:
        """Raise what the system refused.

        Raises:
            OSError: it did.

        """
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()

    def readable(self) -> bool:
        """Say that it can be read."""
        return True

    def writable(self) -> bool:
        """Say that it can be written."""
        return True

    def seekable(self) -> bool:
        """Say that it has places."""
        return True

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        return self._file.seek(place, whence)

    def tell(self) -> int:
        """Return the place."""
        return self._file.tell()

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill the buffer; with zeros beyond the end, and where it cannot be read."""
        done = 0
        try:
            while done < len(buffer) and (got := self._file.readinto(buffer[done:])):
                done += got
        except OSError as error:
            self._failure = self._failure or error
        buffer[done:] = bytes(len(buffer) - done)
        return len(buffer)

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Write all of it, unless a write failed before."""
        done = 0
        try:
            while self._failure is None and done < len(data):
                done += self._file.write(data[done:])
        except OSError as error:
            self._failure = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """Cut it off, or make it longer."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._failure = self._failure or error
            return self._file.tell() if size is None else size
