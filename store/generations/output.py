"""A file for HDF5 to write to that never says no: the library may crash once the system has refused it a write.

What the system said is kept instead, and raised where nothing of HDF5 is under way. The file is to be thrown away then,
so it does not matter what else the library believes to have written. Its many small pieces are put together in memory
and written when the file is closed; large ones, the spectra, go through.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Self

__all__ = ["Output"]

_BLOCK = 1 << 16


class Output(io.RawIOBase):
    """A file that is read and written in any order; `check` raises what went wrong first."""

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        self._size, self._place = os.fstat(self._handle).st_size, 0
        self._blocks: dict[int, bytearray] = {}
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
        """Write what is still in memory, and close the file."""
        if self.closed:
            return
        try:
            for i in sorted(self._blocks):
                self._put(i * _BLOCK, memoryview(self._blocks[i])[: max(self._size - i * _BLOCK, 0)])
            self._blocks.clear()
            if self._failure is None:
                os.truncate(self._handle, self._size)
        except OSError as error:
            self._failure = error
        finally:
            os.close(self._handle)
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
        self._place = place + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        return self._place

    def tell(self) -> int:
        """Return the place."""
        return self._place

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill the buffer; with zeros beyond the end, and where it cannot be read."""
        done = 0
        for i, start, stop in _pieces(self._place, len(buffer)):
            block = self._blocks.get(i)
            found = self._get(i * _BLOCK + start, stop - start) if block is None else block[start:stop]
            buffer[done : done + stop - start] = found
            done += stop - start
        self._place += done
        return done

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Take all of it."""
        done = 0
        for i, start, stop in _pieces(self._place, len(data)):
            piece = data[done : done + stop - start]
            if stop - start == _BLOCK:
                self._blocks.pop(i, None)
                self._put(i * _BLOCK, memoryview(piece))
            else:
                if i not in self._blocks:
                    self._blocks[i] = bytearray(self._get(i * _BLOCK, _BLOCK))
                self._blocks[i][start:stop] = piece
            done += stop - start
        self._place += done
        self._size = max(self._size, self._place)
        return done

    def truncate(self, size: int | None = None) -> int:
        """Cut it off, or make it longer."""
        self._size = self._place if size is None else size
        return self._size

    def _get(self, place: int, size: int) -> bytes:
        try:
            return os.pread(self._handle, size, place).ljust(size, b"\0")
        except OSError as error:
            self._failure = self._failure or error
            return bytes(size)

    def _put(self, place: int, data: memoryview) -> None:
        try:
            while self._failure is None and data:
                written = os.pwrite(self._handle, data, place)
                place, data = place + written, data[written:]
        except OSError as error:
            self._failure = error


def _pieces(place: int, size: int) -> Iterator[tuple[int, int, int]]:
    """Split a stretch of a file by blocks: the number of each, and from where to where it is meant."""
    end = place + size
    while place < end:
        i, start = divmod(place, _BLOCK)
        stop = min(_BLOCK, start + end - place)
        yield i, start, stop
        place += stop - start
