"""JSON with exactly one spelling per value, for hashing and comparing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

__all__ = ["canonical"]

#: Integers up to here are exact as doubles, so 1 and 1.0 are one number.
_EXACT = 2**53
_write = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False).encode


def canonical(value: Any) -> bytes:
    """Return canonical JSON: sorted keys, no blanks, shortest floats, 1.0 as 1, -0.0 as 0, tuples as lists.

    Raises:
        ValueError: NaN or infinity.
        TypeError: something that JSON has no word for, or a key that is not text.

    """
    return _write(_plain(value)).encode("ascii")


def _plain(value: Any) -> Any:
    kind = type(value)
    if kind is str or kind is int:  # most of what there is
        return value
    if kind.__module__ == "numpy" and getattr(value, "shape", None) == ():
        value = value.item()
    if value is None or isinstance(value, bool | str | int):
        return value
    if isinstance(value, float):
        return int(value) if value.is_integer() and abs(value) < _EXACT else value
    if isinstance(value, Mapping):
        if not all(isinstance(name, str) for name in value):
            raise TypeError("the keys of a canonical mapping are strings")
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} has no canonical form")
