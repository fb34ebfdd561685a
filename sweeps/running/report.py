"""What a run tells while it goes on, and at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

__all__ = ["Event", "Failure", "Kind", "Report"]

#: Of a job: it began, advances, is done, was there already, will be tried again, was given up, was taken away.
Kind = Literal["started", "progress", "done", "reused", "retry", "failed", "lost"]


@dataclass(frozen=True)
class Event:
    """Something an observer may show. `finished` of `total` jobs are done or given up; `seconds` of wall time."""

    kind: Kind
    key: str
    params: Mapping[str, Any]
    finished: int
    total: int
    fraction: float = 0.0
    seconds: float = 0.0
    error: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Failure:
    """A job that was given up, with its typed error: code, message, advice."""

    key: str
    params: Mapping[str, Any]
    error: Mapping[str, Any]


@dataclass(frozen=True)
class Report:
    """What a run achieved: `solved` by it, `reused` from before or from others, `failed` for good, `waiting` left."""

    plan: str
    total: int
    solved: int
    reused: int
    failed: tuple[Failure, ...]
    waiting: int
    cancelled: int
    seconds: float
    stopped: bool

    @classmethod
    def of(cls, plan: str, parts: Sequence[Report], total: int) -> Self:
        """Return the report of several runs as one, of which some that belong to the `total` may not have begun."""
        return cls(
            plan=plan,
            total=total,
            solved=sum(part.solved for part in parts),
            reused=sum(part.reused for part in parts),
            failed=tuple(failure for part in parts for failure in part.failed),
            waiting=sum(part.waiting for part in parts) + total - sum(part.total for part in parts),
            cancelled=sum(part.cancelled for part in parts),
            seconds=sum(part.seconds for part in parts),
            stopped=any(part.stopped for part in parts),
        )

    @property
    def complete(self) -> bool:
        """Whether every job has its shard."""
        return self.solved + self.reused == self.total
