"""Parameters that an address does not know are refused by name: misspelt, they would be passed over in silence."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Any

from fastapi import Request

from .errors import InvalidQuery, Wrong

__all__ = ["refuse_others"]

#: What pictures are asked with to have another address when they change.
_VERSION = "v"
#: Where names are those of a table, and looked at there.
_OWN = "/v1/shapes/"


def refuse_others(request: Request) -> None:
    """Refuse names in the query that the address of a request does not declare.

    Raises:
        InvalidQuery: listing them.

    """
    if not request.query_params or request.scope["path"].startswith(_OWN):
        return
    known = sorted({*_names(request.scope["route"].dependant)})
    wrong = [_wrong(name, known) for name in request.query_params if name not in (*known, _VERSION)]
    if wrong:
        raise InvalidQuery.of(wrong)


def _names(dependant: Any) -> Iterator[str]:
    """Yield the query parameters of a handler and of what it depends on."""
    for field in dependant.query_params:
        yield field.alias
    for inner in dependant.dependencies:
        yield from _names(inner)


def _wrong(name: str, known: list[str]) -> Wrong:
    near = difflib.get_close_matches(name, known, n=1)
    advice = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}." if known else "Leave it out."
    return Wrong(name[:40], "is not a parameter of this address", advice)
