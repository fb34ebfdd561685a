"""Leases: until when a running job is its worker's, by clocks that may be another boot's."""

from __future__ import annotations

from sqlite3 import Connection
from typing import Any

from .clock import Clock

__all__ = ["Leases"]

#: Seconds without a sign after which a job is taken over whose lease was noted before leases had clocks.
_OLD_LEASE = 60.0


class Leases:
    """What `clock` says of leases, and what was seen of those that another clock measures."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        #: Leases by another clock than ours: what was last seen of them, and when, by our clock.
        self._watched: dict[str, tuple[tuple[Any, ...], float]] = {}

    def until(self, lease: float) -> tuple[str, float, float]:
        """Return what a lease of so many seconds from now is noted as: the clock, its length, its end."""
        return self._clock.name, lease, self._clock.now() + lease

    def late(self, connection: Connection) -> list[str]:
        """Return the running jobs whose workers let their leases run out.

        The lease of a worker that counts by another clock (another boot) is watched: it has run out when nothing was
        heard of it for its whole length by our own.
        """
        now, late, watched = self._clock.now(), list[str](), dict[str, tuple[tuple[Any, ...], float]]()
        rows = connection.execute("SELECT key, claims, clock, lease, lease_until FROM jobs WHERE state = 'running'")
        for key, *sign in rows:
            _, clock, lease, until = sign
            if clock != self._clock.name:
                seen, since = self._watched.get(key, ((), now))
                watched[key] = tuple(sign), since if seen == tuple(sign) else now
                until = watched[key][1] + (lease or _OLD_LEASE)
            if until < now:
                late.append(key)
        self._watched = watched
        return late
