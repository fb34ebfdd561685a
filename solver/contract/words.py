"""What was given, checked for names and put into words: one sentence per finding."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from .errors import InvalidInput

__all__ = ["SHORT", "named", "say"]

SHORT = reprlib.Repr()
SHORT.maxstring = SHORT.maxother = SHORT.maxlong = 80


def named(values: object) -> Mapping[str, Any]:
    """Return `values` if they are names and values.

    Raises:
        InvalidInput: they are not.

    """
    if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
        raise InvalidInput(
            f"expected names and values, got {SHORT.repr(values)}.", advice='Give an object such as {"te": 0.04}.'
        )
    return values


def say(error: ValidationError, fields: Mapping[str, Any]) -> str:
    """Put pydantic's findings into one sentence per field, with the nearest name for a misspelt one."""
    parts, strange = [], False
    for item in error.errors():
        where = ".".join(str(p) for p in item["loc"])
        if item["type"] == "extra_forbidden":
            # a name within a group is none of the fields, so that none of them is what was meant
            near = difflib.get_close_matches(where, list(fields), n=1) if len(item["loc"]) == 1 else []
            strange |= not near and len(item["loc"]) == 1
            parts.append(f"unknown name {SHORT.repr(where)}" + (f"; did you mean {near[0]!r}?" if near else ""))
        else:
            message = item["msg"].removeprefix("Value error, ")
            got = item.get("input")
            shown = f" (got {SHORT.repr(got)})" if where and not isinstance(got, dict) else ""
            parts.append(f"{where + ': ' if where else ''}{message}{shown}")
    if strange:
        parts.append(f"known: {', '.join(sorted(fields))}")
    return "; ".join(parts)
