"""Where a process lives: what its claims are signed with, and of whom it may say that they are dead.

A process id means something only inside its namespace, and a namespace only until the host starts again. Of processes
anywhere else (another container, another boot, another host) nothing is guessed: their leases run out.
"""

from __future__ import annotations

import os
import secrets
import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from store.ledger.clock import Clock
from store.ledger.jobs import Job

__all__ = ["Place", "is_lost"]

#: Between the parts of a name; a host's name has none.
_BETWEEN = ":"


def _exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


@dataclass(frozen=True)
class Place:
    """A process-id namespace of one boot of a host. `host` is for people; `exists` looks a process up in it."""

    host: str
    boot: str
    namespace: str
    exists: Callable[[int], bool] = _exists

    @classmethod
    def here(cls) -> Place:
        """Return where this process lives."""
        return cls(socket.gethostname().replace(_BETWEEN, "-"), Clock.of_host().name, _namespace())

    def sign(self, pid: int | None = None) -> str:
        """Return a name for a runner here, of this process or another; no two are ever the same."""
        parts = (self.host, self.boot, self.namespace, str(pid or os.getpid()), secrets.token_hex(4))
        return _BETWEEN.join(parts)

    def knows_dead(self, name: str | None) -> bool:
        """Return whether the runner of that name was a process of this very place which no longer exists."""
        match (name or "").split(_BETWEEN):
            case [_, self.boot, self.namespace, pid, _] if pid.isdecimal():
                return not self.exists(int(pid))
        return False


def is_lost(job: Job) -> bool:
    """Return whether nobody runs a running job any more, as far as can be told here: its next runner takes it over."""
    clock = Clock.of_host()
    late = job.clock == clock.name and job.lease_until is not None and job.lease_until < clock.now()
    return late or Place.here().knows_dead(job.worker)


@cache
def _namespace() -> str:
    """Return the name of our process-id namespace; one of its own where the system does not say."""
    try:
        # "pid:[4026531836]": the kernel gives a number again only after the last process of its namespace has ended
        return str(Path("/proc/self/ns/pid").readlink()).partition("[")[2].rstrip("]")
    except OSError:
        return "" if not Path("/proc").is_dir() else secrets.token_hex(8)
