"""What the service itself refuses. These know no HTTP: `service.problems` gives each its status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

__all__ = [
    "BatchTooLarge",
    "BodyTooLarge",
    "EngineDied",
    "Forbidden",
    "InvalidQuery",
    "JobEnded",
    "JobFailed",
    "NotAcceptable",
    "NotDone",
    "OutsideRanges",
    "Overloaded",
    "QueryTooLong",
    "ServiceError",
    "SlowBody",
    "TimedOut",
    "TooCostly",
    "TooManyListeners",
    "TooManySessions",
    "Unauthorized",
    "Unavailable",
    "Uncertain",
    "UncertainBatch",
    "UnfitFormat",
    "UnknownPreset",
    "UnknownSession",
    "UnknownSolver",
    "Wrong",
]


class Wrong(NamedTuple):
    """One wrong parameter: its name, what is wrong with it and what to change."""

    name: str
    detail: str
    advice: str = ""


class ServiceError(Exception):
    """Something asked for that cannot be answered. `advice` says what to change; `wrong` lists every culprit.

    `headers` are for the answer that reports it, `more` is said in it besides.
    """

    code: ClassVar[str] = "service-error"

    def __init__(
        self,
        message: str,
        *,
        advice: str = "",
        wrong: Sequence[Wrong] = (),
        headers: Mapping[str, str] | None = None,
        more: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.advice = advice
        self.wrong = tuple(wrong)
        self.headers = dict(headers or {})
        self.more = dict(more or {})

    def __str__(self) -> str:
        return f"{self.message} {self.advice}".strip()


class InvalidQuery(ServiceError):
    """Parameters that are misspelt, missing or not what they should be."""

    code = "invalid-query"

    @classmethod
    def of(cls, wrong: Sequence[Wrong]) -> Self:
        """Return the error that lists every wrong parameter, with one sentence for all of them."""
        message = "; ".join(f"{w.name}: {w.detail.removesuffix('.')}" for w in wrong)
        advice = " ".join(dict.fromkeys(w.advice for w in wrong if w.advice))
        return cls(message if message.endswith(("?", "!")) else f"{message}.", advice=advice, wrong=wrong)


class OutsideRanges(InvalidQuery):
    """Numbers that are off the table's axes; everything else about the query is right."""

    code = "outside-table"


class Uncertain(InvalidQuery):
    """A shape whose expected error is above what was asked for."""

    code = "too-uncertain"


class UncertainBatch(InvalidQuery):
    """Entries of a batch whose expected error is above what was asked for."""

    code = "too-uncertain"


class BatchTooLarge(InvalidQuery):
    """More shapes, or more lattice points, than one batch may have."""

    code = "batch-too-large"


class NotAcceptable(ServiceError):
    """No representation that the asker accepts."""

    code = "not-acceptable"


class UnfitFormat(InvalidQuery):
    """A format that cannot hold this result, though it can hold others."""

    code = "unfit-format"


class Unavailable(ServiceError):
    """A format whose library is not installed here."""

    code = "format-unavailable"


class UnknownSolver(ServiceError):
    """No solver of that name."""

    code = "unknown-solver"


class UnknownPreset(ServiceError):
    """No preset of that name, or none with a picture."""

    code = "unknown-preset"


class QueryTooLong(ServiceError):
    """A query string longer than any honest one."""

    code = "query-too-long"


class BodyTooLarge(ServiceError):
    """A request body over the limit."""

    code = "body-too-large"


class SlowBody(ServiceError):
    """A request body that takes too long to arrive."""

    code = "slow-body"


class TimedOut(ServiceError):
    """An answer that did not begin in time."""

    code = "timed-out"


class Unauthorized(ServiceError):
    """No token, or one that is not known or no longer good."""

    code = "unauthorized"


class Forbidden(ServiceError):
    """A good token that is not good for this."""

    code = "forbidden"


class TooCostly(ServiceError):
    """A job that would take longer, or hold more, than an operator allows."""

    code = "too-costly"


class NotDone(ServiceError):
    """The result of a job that waits or runs."""

    code = "job-not-done"


class JobFailed(ServiceError):
    """The result of a job that was given up."""

    code = "job-failed"


class JobEnded(ServiceError):
    """A job that cannot be cancelled any more."""

    code = "job-ended"


class Overloaded(ServiceError):
    """Too many shapes wait to be computed."""

    code = "overloaded"


class TooManySessions(ServiceError):
    """As many live sessions are open, or have cost as much, as may be."""

    code = "too-many-sessions"


class UnknownSession(ServiceError):
    """No live session of that name."""

    code = "unknown-session"


class EngineDied(ServiceError):
    """The process of a live engine has ended, or never began."""

    code = "engine-died"


class TooManyListeners(ServiceError):
    """As many event streams are open as may be."""

    code = "too-many-listeners"
