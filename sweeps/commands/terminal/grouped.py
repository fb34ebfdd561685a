"""Commands of many options: each field of a dataclass is a word of the command line; the command gets the value."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import MISSING, fields
from inspect import Parameter, Signature
from typing import Any, TypeVar, get_type_hints

__all__ = ["grouped"]

T = TypeVar("T")


def grouped(options: type[T]) -> Callable[[Callable[[T], None]], Callable[..., None]]:
    """Return a decorator that makes a Typer command of a function of one `options`, a dataclass whose fields are
    annotated as a command's arguments are.
    """

    def dress(command: Callable[[T], None]) -> Callable[..., None]:
        @functools.wraps(command)
        def run(**given: Any) -> None:
            command(options(**given))

        hints = get_type_hints(options, include_extras=True)
        run.__annotations__ = {**hints, "return": None}
        run.__signature__ = Signature(  # type: ignore[attr-defined]
            [
                Parameter(
                    each.name,
                    Parameter.KEYWORD_ONLY,
                    default=Parameter.empty if each.default is MISSING else each.default,
                    annotation=hints[each.name],
                )
                for each in fields(options)  # type: ignore[arg-type]
            ]
        )
        return run

    return dress
