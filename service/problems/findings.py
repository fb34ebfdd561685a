"""What is wrong with a body, an address or a query that its model refuses: each finding by its place, with advice.

A model finds fault with a value by every form that the value might have had. What is told is of the form that the
value comes nearest to: the one whose findings lie deepest in what was sent, and are of more than its kind.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ..errors import Wrong

__all__ = ["wrong"]

#: More findings help nobody, and longer ones are what was sent.
_MOST, _LENGTH = 50, 400

_OBJECT = "Send a JSON object, with Content-Type: application/json."
_ADVICE: Mapping[str, str] = {
    "missing": "Add it.",
    "extra_forbidden": "Leave it out; /docs lists what there is.",
    "json_invalid": "Send JSON, with Content-Type: application/json.",
    "finite_number": "Take finite numbers.",
    "literal_error": "Take one of these.",
    "enum": "Take one of these.",
}
_BOUNDS = ("greater_than", "less_than", "too_short", "too_long")

Finding = Mapping[str, Any]


class _Found(NamedTuple):
    """A finding, the keys and indices in what was sent that lead to it, and the forms that it is of: where each was
    tried (a number of keys), and its name.
    """

    item: Finding
    place: tuple[int | str, ...]
    forms: tuple[tuple[int, int | str], ...]

    @property
    def nearness(self) -> tuple[int, bool]:
        """How near what was sent came to this form."""
        return len(self.place), not str(self.item["type"]).endswith("_type")


def wrong(findings: Iterable[Finding], sent: Any) -> list[Wrong]:
    """Return what to tell of a model's findings; `sent` is the body, None where there was none."""
    found = [_of(item, sent) for item in findings]
    return [_told(one) for one in _nearest(found)[:_MOST]]


def _of(item: Finding, sent: Any) -> _Found:
    where, *loc = item["loc"]
    if where != "body" or item["type"] == "json_invalid":
        return _Found(item, () if where == "body" else tuple(loc), ())
    place: list[int | str] = []
    forms: list[tuple[int, int | str]] = []
    for i, part in enumerate(loc):
        is_absent = item["type"] == "missing" and i == len(loc) - 1
        if isinstance(sent, dict) and (part in sent or is_absent):
            sent = sent.get(part)
        elif isinstance(sent, list) and isinstance(part, int) and part < len(sent):
            sent = sent[part]
        else:
            forms.append((len(place), part))
            continue
        place.append(part)
    return _Found(item, tuple(place), tuple(forms))


def _nearest(found: Sequence[_Found], level: int = 0) -> list[_Found]:
    """Return the findings without those of forms that what was sent does not come nearest to."""
    tried: dict[tuple[int | str, ...], dict[int | str, tuple[int, bool]]] = {}
    for one in found:
        if len(one.forms) > level:
            depth, form = one.forms[level]
            forms = tried.setdefault(one.place[:depth], {})
            forms[form] = max(forms.get(form, one.nearness), one.nearness)
    if not tried:
        return list(found)

    def is_told(one: _Found) -> bool:
        if len(one.forms) <= level:
            return True
        depth, form = one.forms[level]
        forms = tried[one.place[:depth]]
        return forms[form] == max(forms.values())

    return _nearest([one for one in found if is_told(one)], level + 1)


def _told(one: _Found) -> Wrong:
    kind, where = str(one.item["type"]), str(one.item["loc"][0])
    detail = str(one.item["msg"]).removeprefix("Value error, ")
    if kind == "json_invalid":
        detail += f" at character {one.item['loc'][-1]}"
    given = one.item.get("input")
    shown = f" (got {given!r})" if isinstance(given, str | int | float) and kind != "json_invalid" else ""
    return Wrong(".".join(map(str, one.place)) or where, f"{detail}{shown}"[:_LENGTH], _advice(kind, one.place, where))


def _advice(kind: str, place: tuple[int | str, ...], where: str) -> str:
    if where == "body" and not place and kind != "json_invalid":
        return _OBJECT
    if kind in _ADVICE:
        return _ADVICE[kind]
    return (
        "Keep to these bounds."
        if kind.endswith(_BOUNDS) or kind.startswith(_BOUNDS)
        else "See /docs for what it takes."
    )
