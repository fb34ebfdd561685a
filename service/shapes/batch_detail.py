"""The points of a batch with a level of detail each, and what they have in common: equal ones are computed once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from store.shape import Shape

from ..errors import InvalidQuery, Wrong
from ..formats import About
from . import detail as level
from .batch_request import BatchRequest
from .query import LOWEST_RESOLUTION, ShapeQuery

__all__ = ["NAMES", "Asked", "distinct", "each_once", "entry", "levels", "summed"]

#: What a point may say of its own level of detail.
NAMES = ("resolution", "screen_px", "distance", "fov")
#: Bytes of shapes that wait for a later point that asks for them again; beyond it they are computed again.
_WAITING = 64 << 20


class Asked(NamedTuple):
    """One point of a batch: what to look up, at which resolution, and what is said of the choice."""

    query: ShapeQuery
    resolution: int
    said: dict[str, Any]

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for points that get the same bytes."""
        return tuple(sorted(self.query.point.items())), self.query.stage, self.resolution, repr(self.said)


class Level(NamedTuple):
    """The resolution of one point, and what is said of the choice."""

    resolution: int
    said: dict[str, Any]


def levels(
    entries: Sequence[Mapping[str, float]], body: BatchRequest, own: int, highest: int
) -> tuple[list[Level], list[Wrong]]:
    """Return the points' levels of detail, each one's own where it names one, and what is wrong with any of them."""
    common = level.read(body.detail)
    resolution = common.resolution(body.resolution, own, highest)
    usual = Level(resolution, common.said(resolution, own))
    rest = {name: text for name, text in body.detail.items() if name not in NAMES}
    found: list[Level] = []
    wrong: list[Wrong] = []
    for i, given in enumerate(entries):
        named = {name: f"{given[name]:.17g}" for name in NAMES if name in given}
        if not named:
            found.append(usual)
            continue
        count = given.get("resolution")
        refused = [] if count is None else _resolution(count, highest)
        detail = level.read({**rest, **named})
        wrong += entry(i, [*refused, *detail.wrong])
        chosen = detail.resolution(None if count is None else int(count), own, highest)
        found.append(Level(chosen, detail.said(chosen, own) if not refused else {}))
    return found, wrong


def _resolution(count: float, highest: int) -> list[Wrong]:
    if count.is_integer() and LOWEST_RESOLUTION <= count <= highest:
        return []
    advice = f"Take {LOWEST_RESOLUTION} to {highest}; an operator raises the limit with WIZEN_MAX_RESOLUTION."
    return [Wrong("resolution", f"{count:g} is no number of colatitude samples that may be asked for", advice)]


def distinct(points: Sequence[Asked]) -> tuple[list[Asked], list[int]]:
    """Return the points without repeats, in the order of their first, and for each point which of those it is."""
    numbers: dict[tuple[Any, ...], int] = {}
    rows = [numbers.setdefault(one.key, len(numbers)) for one in points]
    first = dict(zip(reversed(rows), reversed(points), strict=True))
    return [first[row] for row in range(len(numbers))], rows


def each_once(
    points: Sequence[Asked],
    sent: Sequence[Asked],
    look_up: Callable[[Asked], Shape],
    about: Callable[[Asked], About],
) -> Iterator[tuple[Shape, About]]:
    """Yield what is sent in its order, computing each of the distinct `points` once while memory lasts."""
    left = dict.fromkeys((one.key for one in points), 0)
    for one in sent:
        left[one.key] += 1
    held: dict[tuple[Any, ...], Shape] = {}
    size = 0
    for one in sent:
        left[one.key] -= 1
        shape = held.get(one.key)
        if shape is None:
            shape = look_up(one)
            if left[one.key] and size + _bytes(shape) <= _WAITING:
                held[one.key], size = shape, size + _bytes(shape)
        elif not left[one.key]:
            size -= _bytes(held.pop(one.key))
        yield shape, about(one)


def _bytes(shape: Shape) -> int:
    return sum(array.nbytes for array in (shape.position, shape.displacement) if array is not None)


def entry(i: int, wrong: tuple[Wrong, ...] | list[Wrong]) -> list[Wrong]:
    """Return what is wrong with entry `i`, named with its number."""
    return [Wrong(f"points[{i}]" + (f".{w.name}" if w.name else ""), w.detail, w.advice) for w in wrong]


def summed(kind: type[InvalidQuery], wrong: list[Wrong]) -> InvalidQuery:
    """Return an error that lists all, with a sentence on the first few."""
    error = kind.of(wrong[:3])
    more = "" if len(wrong) <= 3 else f" And {len(wrong) - 3} more."
    return kind(f"{error.message}{more}", advice=error.advice, wrong=wrong)
