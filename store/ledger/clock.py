"""The clock of leases: seconds since this host started, which no step of the date moves.

A lease is a claim on time, and the date is not time: it is set by hand, corrected by NTP, wrong in one container and
right in another. All processes of one host share this counter, in whatever namespace they live; `name` tells one
boot's counter from another's, so that two of them are never compared.
"""

from __future__ import annotations

import secrets
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

__all__ = ["Clock"]

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_OFFSETS = Path("/proc/self/timens_offsets")


@dataclass(frozen=True)
class Clock:
    """A counter of seconds with a name; readings of two clocks of one name may be compared."""

    name: str
    now: Callable[[], float]

    @classmethod
    def of_host(cls) -> Clock:
        """Return the counter that all processes share which run here since the host started."""
        offset = _namespace_offset()
        return cls(_boot(), lambda: time.monotonic() - offset)


@cache
def _boot() -> str:
    """Return a name of this boot; where the system has none, one of this process, which then compares with nobody."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        pass
    if sys.platform == "darwin":
        asked = subprocess.run(["sysctl", "-n", "kern.bootsessionuuid"], capture_output=True, text=True, check=False)
        if asked.returncode == 0 and asked.stdout.strip():
            return asked.stdout.strip()
    return secrets.token_hex(16)


@cache
def _namespace_offset() -> float:
    """Return by how much a time namespace shifts our counter against the host's [s]."""
    try:
        rows = [line.split() for line in _OFFSETS.read_text().splitlines()]
    except OSError:
        return 0.0
    return sum(float(row[1]) + 1e-9 * float(row[2]) for row in rows if len(row) == 3 and row[0] == "monotonic")
