"""Entity tags: whether an asker has already what a question is about."""

from __future__ import annotations

__all__ = ["matches"]


def matches(header: str, tag: str, there: bool = True) -> bool:
    """Return whether an If-None-Match header names a tag, or takes any (`*`) and what it is of is known to be `there`.

    The comparison is the weak one, as RFC 9110 has it.
    """
    if header.strip() == "*":
        return there
    return tag.removeprefix("W/") in {part.strip().removeprefix("W/") for part in header.split(",")}
