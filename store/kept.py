"""What is made once and asked for again: kept by its size, the last used longest. Safe among threads.

How many of them a table has depends on its grid, and how large they are on its spectra: a number of them would be too
few for one table and too much memory for another. Tables share a room: a service may have any number of them open.
"""

from __future__ import annotations

import itertools
import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

__all__ = ["Kept", "Part"]

K = TypeVar("K")
V = TypeVar("V")


class Kept(Generic[K, V]):
    """Values by key, up to `room` bytes of them, but one at least; `size` says how many bytes one has."""

    def __init__(self, room: int, size: Callable[[V], int]) -> None:
        self._room, self._size = room, size
        self._values: OrderedDict[K, V] = OrderedDict()
        self._held = 0
        # what drops a dead owner's values may run while this thread is within
        self._guard = threading.RLock()

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key, made where it is not kept: by several threads at a time, if it comes to that."""
        with self._guard:
            kept = self._values.get(key)
            if kept is not None:
                self._values.move_to_end(key)
                return kept
        made = make()
        with self._guard:
            if key not in self._values:
                self._held += self._size(made)
            self._values[key] = made
            self._values.move_to_end(key)
            while len(self._values) > 1 and self._held > self._room:
                self._held -= self._size(self._values.popitem(last=False)[1])
        return made

    def drop(self, which: Callable[[K], bool]) -> None:
        """Keep none of the keys of which that is true."""
        with self._guard:
            for key in list(self._values):
                if which(key) and key in self._values:
                    self._held -= self._size(self._values.pop(key))


class Part(Generic[K, V]):
    """One owner's values in a room that owners share; none is kept once the owner is gone."""

    def __init__(self, shared: Kept[tuple[int, K], V], owner: object) -> None:
        self._shared, number = shared, next(_numbers)
        self._number = number
        weakref.finalize(owner, shared.drop, lambda key: key[0] == number).atexit = False

    def get(self, key: K, make: Callable[[], V]) -> V:
        """Return the owner's value of a key, made where it is not kept."""
        return self._shared.get((self._number, key), make)


_numbers = itertools.count()
