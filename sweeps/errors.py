"""What the batch floor refuses. Every error has a stable code, says what is wrong and what to change."""

from __future__ import annotations

from typing import Any, ClassVar

from store.errors import Advised

__all__ = ["BAD_INPUT", "InvalidOption", "PlanError", "SweepError", "describe", "exit_code", "installing"]

#: Codes that mean "what was asked for is wrong", as opposed to "it could not be done". Tables, jobs and tokens that a
#: store does not hold are of the second kind, as a store that is not there is: the same line may do tomorrow.
BAD_INPUT = frozenset(
    {
        "invalid-input",
        "invalid-geometry",
        "invalid-plan",
        "invalid-option",
        "invalid-query",
        "outside-table",
        "too-uncertain",
    }
)


class SweepError(Advised):
    """Something that a sweep or the command line refuses or cannot do. `advice` says what to change."""

    code: ClassVar[str] = "sweep-error"


class PlanError(SweepError):
    """A plan that says something wrong; found before any work."""

    code = "invalid-plan"


class InvalidOption(SweepError):
    """A value on the command line that has no meaning there."""

    code = "invalid-option"


def describe(error: BaseException) -> dict[str, Any]:
    """Return an error as the JSON object that ledger, service and `--json` show: code, message, advice and extras."""
    said = {
        "code": getattr(error, "code", "internal-error"),
        "message": getattr(error, "message", f"{type(error).__name__}: {error}"),
        "advice": getattr(error, "advice", ""),
    }
    extras = {name: getattr(error, name, None) for name in ("last_stage", "residual")}
    return said | {name: value for name, value in extras.items() if value is not None}


def exit_code(error: BaseException) -> int:
    """Return 2 for bad input, 1 for everything else. Subclasses of a bad-input error are bad input."""
    return 2 if any(getattr(kind, "code", None) in BAD_INPUT for kind in type(error).__mro__) else 1


def installing(extra: str) -> str:
    """Return how to install what the extra of that name brings; wizen is on no index, so there is only its checkout."""
    return f"Run `pip install -e '.[{extra}]'` in wizen's checkout."
