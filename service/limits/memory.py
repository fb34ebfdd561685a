"""Memory that is not needed goes back to the system: glibc keeps what many workers together would miss.

Its threshold for blocks of their own grows with every large block that is freed, up to 32 MB; what lies below it stays
in the heap, and with threads in one heap for each. Set once, the threshold no longer grows.
"""

from __future__ import annotations

import ctypes
import sys

__all__ = ["settle"]

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
