"""What was given, checked for names and put into words: one sentence per finding."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

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
            within = list(fields) if len(item["loc"]) == 1 else _within(fields, item["loc"])
            near = difflib.get_close_matches(str(item["loc"][-1]), within, n=1)
            strange |= not near and len(item["loc"]) == 1
            hint = f"; did you mean {near[0]!r}?" if near else ""
            if within and not near and len(item["loc"]) > 1:
                hint = f"; known there: {', '.join(within)}"
            parts.append(f"unknown name {SHORT.repr(where)}{hint}")
        else:
            message = item["msg"].removeprefix("Value error, ")
            got = item.get("input")
            shown = f" (got {SHORT.repr(got)})" if where and not isinstance(got, dict) else ""
            parts.append(f"{where + ': ' if where else ''}{message}{shown}")
    if strange:
        parts.append(f"known: {', '.join(sorted(fields))}")
    return "; ".join(parts)


def _within(fields: Mapping[str, Any], place: tuple[int | str, ...]) -> list[str]:
    """Return the names that there are where a wrong one was found, in a group within the fields."""
    first = fields.get(str(place[0]))
    models = _models(getattr(first, "annotation", None))
    for step in place[1:-1]:
        if isinstance(step, int):
            continue
        inner = [model.model_fields[step].annotation for model in models if step in model.model_fields]
        if inner:
            models = [model for annotation in inner for model in _models(annotation)]
        else:  # what tells the forms of a union apart
            models = [m for m in models if any(field.default == step for field in m.model_fields.values())]
    return sorted({name for model in models for name in model.model_fields})


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that an annotation names, in whatever containers."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]
