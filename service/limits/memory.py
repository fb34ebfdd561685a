"""Memory that is not needed goes back to the system, and what stays is not looked through again and again.

glibc keeps what many workers together would miss. Its threshold for blocks of their own grows with every large block
that is freed, up to 32 MB; what lies below it stays in the heap, and with threads in one heap for each. Set once, the
threshold no longer grows.
"""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

__all__ = ["keep", "loading", "settle"]

#: `mallopt`'s names in malloc.h, and what they are set to. Results of a look-up at 256 colatitudes stay below.
_TRIM, _MMAP, _ARENAS = -1, -3, -8
_LARGE, _HELD, _FEW = 2 << 20, 8 << 20, 2


def settle() -> bool:
    """Settle the limits of this process; return whether its allocator knows them."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        set_ = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False  # another libc
    return all([set_(_MMAP, _LARGE), set_(_TRIM, _HELD), set_(_ARENAS, _FEW)])


@contextmanager
def loading() -> Iterator[None]:
    """Leave the garbage collector off until `keep`: its walks take a tenth of the time of loading, and free nothing."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def keep(what: str) -> None:
    """Take all there is by now out of what the garbage collector walks through, once for each `what` that was loaded.

    Modules, routes and schemas stay for as long as the process does. Under load a walk through them all came every few
    seconds, and everybody waited for it for a tenth of a second; in a scene of 10,000 items, walks took as long as
    everything else. What is freed by counting references, as tables are, still is.
    """
    _freeze(what)
    gc.enable()


@lru_cache
def _freeze(what: str) -> None:
    gc.collect()
    gc.freeze()
