"""The words that every session understands, whatever its engine does, and how problems are said."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from solver.contract import InvalidInput, SolverError

__all__ = ["OWN", "QUALITIES", "check", "number_of", "problem"]

QUALITIES = ("preview", "default", "fine")
#: What every session understands, and the names of what goes with it.
OWN: Mapping[str, tuple[str, ...]] = {
    "play": ("until", "pace"),
    "pause": (),
    "undo": (),
    "redo": (),
    "quality": ("quality",),
    "settle": (),
    "save": (),
    "whole": (),
}


def check(what: str, values: Mapping[str, Any]) -> None:
    """Refuse what a word of the session's own does not take.

    Raises:
        InvalidInput: a name that it does not know.

    """
    strange = [name for name in values if name not in OWN[what]]
    if strange:
        known = ", ".join(OWN[what]) or "nothing"
        raise InvalidInput(f"{what} does not take {strange[0]!r}.", advice=f"It takes {known}.")


def number_of(name: str, value: Any) -> float:
    """Return a number, infinite where there is none.

    Raises:
        InvalidInput: it is no number.

    """
    if value is None:
        return math.inf
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InvalidInput(f"{name}: {value!r} is no number.", advice="Or leave it out.")
    return float(value)


def problem(error: SolverError) -> dict[str, Any]:
    """Return an error in the words of a problem (RFC 9457), but for its status."""
    title = error.code.replace("-", " ").capitalize()
    return {"type": f"urn:wizen:problem:{error.code}", "title": title, "detail": error.message, "advice": error.advice}
