"""Every failure of a solver: typed, and saying what to change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Cancelled", "InvalidGeometry", "InvalidInput", "NotConverged", "OverBudget", "SolverError", "Unstable"]


class SolverError(Exception):
    """Something a solver refuses or cannot finish. `advice` says what to change; `partial` holds what converged.

    `last_stage` is the last stage that converged (None if there is none) and `partial` the dataset of the stages
    up to it, complete and finite.
    """

    code: ClassVar[str] = "solver-error"

    def __init__(
        self,
        message: str,
        *,
        advice: str = "",
        partial: xr.Dataset | None = None,
        last_stage: float | None = None,
        residual: float | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.advice = advice
        self.partial = partial
        self.last_stage = last_stage
        self.residual = residual

    def __str__(self) -> str:
        return f"{self.message} {self.advice}".strip()

    def __reduce__(self) -> tuple[Any, ...]:
        # keyword-only arguments do not survive the default pickling, and errors travel between processes
        return _rebuild, (type(self), self.message, self.advice, self.partial, self.last_stage, self.residual)


def _rebuild(
    kind: type[SolverError],
    message: str,
    advice: str,
    partial: xr.Dataset | None,
    last_stage: float | None,
    residual: float | None,
) -> SolverError:
    return kind(message, advice=advice, partial=partial, last_stage=last_stage, residual=residual)


class InvalidInput(SolverError):
    """Parameters or a need that no run could honour; raised before any work."""

    code = "invalid-input"


class InvalidGeometry(InvalidInput):
    """Parameters that are valid one by one but describe an impossible shape."""

    code = "invalid-geometry"


class OverBudget(InvalidInput):
    """A run that takes more time or memory than it may: before any work where that can be foreseen, else on the way."""

    code = "over-budget"


class NotConverged(SolverError):
    """A stage that did not reach its residual."""

    code = "not-converged"


class Unstable(SolverError):
    """A run whose state left the finite or the admissible: inverted elements, exploding energy."""

    code = "unstable"


class Cancelled(SolverError):
    """The observer asked to stop."""

    code = "cancelled"
