"""Digest of the kernel's sources: numba caches a function by its own file only, we cache it by all of them."""

from __future__ import annotations

import hashlib
from pathlib import Path

KERNEL = Path(__file__).parents[1]


def source_digest(backend: str) -> str:
    """Hex digest of every file that the compiled loop may be made of, and of the back end's name.

    All files of these rooms count, needed or not: a needless compilation costs seconds, a stale kernel a wrong table.
    """
    digest = hashlib.sha256(backend.encode())
    rooms = [KERNEL, KERNEL / "generate", KERNEL.parent / "contact"]
    shared = [KERNEL.parents[1] / "geometry" / name for name in ("closest.py", "crossings.py")]
    for path in [path for room in rooms for path in sorted(room.glob("*.py"))] + shared:
        digest.update(b"\0" + path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
