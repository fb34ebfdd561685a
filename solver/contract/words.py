"""What was given, checked for names and put into words: one sentence per finding."""

from __future__ import annotations

import difflib
import json
import reprlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from .errors import InvalidInput

__all__ = ["SHORT", "Place", "advise", "named", "say"]

#: Bounds as pydantic names them, in words.
_BOUNDS = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}

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


#: Where pydantic finds what is wrong: names and numbers, from outside inwards.
Place = tuple[int | str, ...]


def say(error: ValidationError, fields: Mapping[str, Any], typed: Mapping[Place, str] = MappingProxyType({})) -> str:
    """Put pydantic's findings into one sentence per field, with the nearest name for a misspelt one.

    `typed` says by place what a value was called by whoever gave it, where that is another name than the field's.
    """
    parts, strange = [], False
    for item in error.errors():
        # of a tuple each value that is missing is found: one sentence about the whole says it
        where = _called(item["loc"][:1] if _too_few(item) else item["loc"], typed)
        if item["type"] == "extra_forbidden":
            hint = _hint(fields, item["loc"])
            strange |= not hint and len(item["loc"]) == 1
            parts.append(f"unknown name {SHORT.repr(where)}{hint}")
        else:
            # who puts findings into a sentence ends it
            message = _kind(item) or _form(item, fields) or item["msg"].removeprefix("Value error, ").removesuffix(".")
            got = item.get("input")
            shown = f" (got {SHORT.repr(got)})" if where and not isinstance(got, dict) else ""
            parts.append(f"{where + ': ' if where else ''}{message}{shown}")
    if strange:
        parts.append(f"known: {', '.join(sorted(fields))}")
    return "; ".join(dict.fromkeys(parts))


def advise(error: ValidationError, typed: Mapping[Place, str] = MappingProxyType({})) -> str:
    """Return what to give instead of what is off its bounds or no number, a sentence each; "" where a finding says so
    itself. `typed` as in `say`.
    """
    said = []
    for item in error.errors():
        where, context = _called(item["loc"], typed), item.get("ctx", {})
        bound = next((f"{word} {context[name]:g}" for name, word in _BOUNDS.items() if name in context), "")
        if bound and where:
            said.append(f"Give {where} {bound}.")
        elif item["type"].startswith("int_"):
            said.append(f"Give {where} a whole number.")
        elif item["type"] in ("float_parsing", "float_type", "finite_number"):
            said.append(f"Give {where} a finite number.")
        elif item["type"] == "union_tag_not_found":
            said.append(f"Give {where} a {context['discriminator'].strip(chr(39))}.")
    return " ".join(said)


def _kind(item: Mapping[str, Any]) -> str:
    """Say what is wrong with the name that tells one kind of thing from another; "" where that is not what is."""
    context = item.get("ctx", {})
    name = context.get("discriminator", "").strip("'")
    if item["type"] == "union_tag_not_found":
        return f"it does not say of which {name} it is"
    if item["type"] != "union_tag_invalid":
        return ""
    known = context["expected_tags"].replace("'", "").split(", ")
    near = difflib.get_close_matches(context["tag"], known, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"there is no {name} {SHORT.repr(context['tag'])}; {hint}known: {', '.join(known)}"


def _form(item: Mapping[str, Any], fields: Mapping[str, Any]) -> str:
    """Say what a field is, with an example, where what was given has another form; "" where that is not what is."""
    place, kind = item["loc"], item["type"]
    field = fields.get(str(place[0])) if place else None
    annotation, default = getattr(field, "annotation", None), getattr(field, "default", None)
    several = _too_few(item) or (len(place) == 1 and kind in ("tuple_type", "too_long"))
    if isinstance(default, tuple) and default and several:
        return f"{place[0]} needs {len(default)} values, such as {json.dumps(default)}"
    if len(place) == 1 and kind == "model_type" and len(models := _models(annotation)) == 1:
        needed = [name for name, inner in models[0].model_fields.items() if inner.is_required()]
        more = [name for name in models[0].model_fields if name not in needed]
        return f"it needs an object with {', '.join(needed)}{' and, if wanted, ' * bool(more)}{', '.join(more)}"
    return ""


def _too_few(item: Mapping[str, Any]) -> bool:
    """Return whether a tuple lacks a value."""
    place = item["loc"]
    return len(place) == 2 and item["type"] == "missing" and isinstance(place[1], int)


def _called(place: Place, typed: Mapping[Place, str]) -> str:
    """Return the name of a place: what was typed, and behind it the field's, which the documents have."""
    where = ".".join(str(part) for part in place)
    own = next((typed[place[:k]] for k in range(len(place), 0, -1) if place[:k] in typed), "")
    return f"{own} ({where})" if own else where


def _hint(fields: Mapping[str, Any], place: Place) -> str:
    """Return what was probably meant by a name that does not exist, or what there is where it stands."""
    name, alone = str(place[-1]), len(place) == 1
    group, _, inner = name.partition(".")
    if alone and inner and (there := _within(fields, (group, inner))):
        # errors name what is in a group so, but nothing can be set so
        typed = f"{group}={{{json.dumps(inner)}: ...}}" if inner in there else f"{group}={{...}}"
        return f"; {group} is one value, {typed}, an object of {', '.join(there)}"
    within = list(fields) if alone else _within(fields, place)
    near = difflib.get_close_matches(name, within, n=1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; known there: {', '.join(within)}" if within and not alone else ""


def _within(fields: Mapping[str, Any], place: Place) -> list[str]:
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
