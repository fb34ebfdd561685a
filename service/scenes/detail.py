"""Which level of detail every seen instance gets: what the screen shows, less where the budget is smaller."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from solver.arrays import Array, Floats

from ..errors import Wrong
from ..shapes.detail import PIXELS_PER_CELL
from .errors import OverBudget
from .kinds import RUNGS, Kind
from .request import Budget

__all__ = ["RUNGS", "Levels", "choose", "expected", "over"]

#: By how much the lattices shrink from try to try, and how often before a budget is called too small.
_LESS, _TRIES = 0.84, 28
#: Bytes of a file, measured: by vertex, by triangle of a lattice (which shapes share; USD's have their own, by vertex),
#: by instance, by mesh and by node.
_BYTES = {
    "packed": (9.5, 1.4, 22.0, 520.0, 560.0),
    "glb": (16.0, 6.0, 32.0, 430.0, 480.0),
    "usdc": (36.2, 0.0, 32.0, 375.0, 0.0),
    "usda": (152.0, 0.0, 51.0, 1880.0, 0.0),
}
#: Bytes of an instance that changes over time, which glTF has as a node with a channel of its own.
_CHANGING = 290.0
#: A triangle of a mesh of its own, over one of a lattice: its neighbours are not where one expects them.
_OWN = 2.0
#: How many kinds are named when something is to be dropped.
_NAMED = 4
#: A look-up [ms]: of any lattice, and by squared colatitude; only said as an expectation.
_MILLISECONDS = (1.4, 2.6e-4)


class Levels(NamedTuple):
    """Levels (colatitudes of lattices) by seen instance (b), those that the screen asks for (b), and what the file will
    cost: triangles drawn, bytes and milliseconds expected. `share` is 1 where the budget took nothing away.
    """

    n: Array
    wanted: Array
    triangles: int
    bytes: float
    milliseconds: float
    share: float


def choose(
    budget: Budget,
    kinds: Sequence[Kind],
    kind: Array,
    pixels: Floats,
    form: str,
    most: float = 1.0,
    mirrored: Array | None = None,
    measured: bool = False,
) -> Levels:
    """Return the levels of seen instances in a file of a form: `packed` for a compressed GLB, else the format's name.

    `mirrored` says which are mirror images, none if left out. `most` is the share of the screen's wish to begin with.
    Where the file is `measured` afterwards, bytes that are only expected refuse nothing: the coarsest levels are
    returned.

    Raises:
        OverBudget: even the coarsest levels cost more; it says what to drop.

    """
    own = np.array([k.finest for k in kinds])
    top = own[kind] if len(kind) else np.zeros(0, int)
    wanted = np.minimum(_rung(pixels, 1.0), top)
    share, levels = most, None
    for _ in range(_TRIES):
        n = np.minimum(_rung(pixels, share), top)
        levels = Levels(n, wanted, *expected(kinds, kind, n, form, mirrored), share)
        if _fits(budget, levels):
            return levels
        if (n == RUNGS[0]).all():
            break
        share *= _LESS
    assert levels is not None
    rest = budget.model_copy(update={"bytes": None}) if measured else budget
    if _fits(rest, levels):
        return levels
    raise OverBudget.of(over(budget, levels, kinds, kind, pixels, form, mirrored))


def expected(
    kinds: Sequence[Kind], kind: Array, n: Array, form: str, mirrored: Array | None = None
) -> tuple[int, float, float]:
    """Return triangles drawn, bytes and milliseconds to expect of instances of kinds with levels.

    What has a mesh of its own costs no look-up, and as many bytes as that mesh has vertices and triangles.
    """
    if not len(n):
        return 0, 2000.0, 0.0
    a_vertex, a_triangle, an_instance, a_mesh, a_node = _BYTES[form]
    # a mesh has vertices for each stage of its curve, and where it may be had at others for each of these
    is_usd = form.startswith("usd")
    stages = np.array([max(len(k.curve), 1) + (len(k.variants) if is_usd else 0) for k in kinds])
    changing = 0 if is_usd else int((np.array([len(k.curve) for k in kinds])[kind] > 0).sum())
    # USD has meshes of their own for mirror images
    twin = np.asarray(mirrored, int) if is_usd and mirrored is not None else np.zeros(len(n), int)
    looked = np.array([one.topology is None for one in kinds])[kind]
    drawn, size = int((4 * n[looked].astype(np.int64) ** 2).sum()), 0.0
    if not looked.all():
        parts = np.stack([kind[~looked], n[~looked], twin[~looked]])
        own, copies = np.unique(parts, axis=1, return_counts=True)
        triangles = np.array([kinds[k].count(int(level)) for k, level, _ in own.T])
        drawn += int((triangles * copies).sum())
        each = triangles * (0.5 * a_vertex * stages[own[0]] + _OWN * a_triangle)
        size += float((each + a_mesh + 1.7 * a_node).sum())
    whose, pairs, _ = np.unique(np.stack([kind[looked], n[looked], twin[looked]]), axis=1)
    lattices = np.unique(n[looked]).astype(float)
    size += float((2.0 * pairs**2 * a_vertex * stages[whose] + a_mesh + 1.7 * a_node).sum())
    whose, pairs = np.unique(np.stack([kind[looked], n[looked]]), axis=1)
    size += float((4 * lattices**2 * a_triangle).sum()) + an_instance * len(n) + _CHANGING * changing + 2000
    spent = float(((_MILLISECONDS[0] + _MILLISECONDS[1] * pairs**2) * stages[whose]).sum())
    spent += _MILLISECONDS[0] * float(stages[np.unique(kind[looked])].sum())
    return drawn, size, spent


def _rung(pixels: Floats, share: float) -> Array:
    cells = share * math.pi * pixels / (2 * PIXELS_PER_CELL)
    found: Array = RUNGS[np.minimum(np.searchsorted(RUNGS, cells), len(RUNGS) - 1)]
    return found


def _fits(budget: Budget, levels: Levels) -> bool:
    limits = (
        (budget.bytes, levels.bytes),
        (budget.triangles, levels.triangles),
        (budget.milliseconds, levels.milliseconds),
    )
    return all(limit is None or cost <= limit for limit, cost in limits)


def over(
    budget: Budget,
    least: Levels,
    kinds: Sequence[Kind],
    kind: Array,
    pixels: Floats,
    form: str,
    mirrored: Array | None = None,
    factor: float | None = None,
) -> list[Wrong]:
    """Return which limits are too low, and which of the smallest instances to drop for each.

    factor: how many times as many bytes came out as were expected; None: there is no file yet.
    """
    wrong, larger = [], factor or 1.0
    twin = np.zeros(len(kind), bool) if mirrored is None else mirrored
    costs = {"bytes": larger * least.bytes, "triangles": least.triangles, "milliseconds": least.milliseconds}
    for name, cost in costs.items():
        limit = getattr(budget, name)
        if limit is None or cost <= limit:
            continue
        about = "about " if name == "bytes" and factor is None else ""
        advice = f"Allow {about}{math.ceil(cost)}: dropping some is not enough."
        for gone in _candidates(name, kind, pixels):
            rest = np.ones(len(kind), bool)
            rest[gone] = False
            drawn, size, spent = expected(kinds, kind[rest], least.n[rest], form, twin[rest])
            if {"bytes": larger * size, "triangles": drawn, "milliseconds": spent}[name] <= limit:
                advice = (
                    f"Drop the {len(gone)} smallest of {len(kind)} in sight (up to {pixels[gone].max():.3g} pixels "
                    f"across: {_named(kinds, kind[gone])}), or allow {about}{math.ceil(cost)}."
                )
                break
        wrong.append(
            Wrong(f"budget.{name}", f"{limit:g} are too few: the coarsest shapes take {about}{cost:.0f}", advice)
        )
    return wrong


def _candidates(name: str, kind: Array, pixels: Floats) -> Iterator[Array]:
    """Return what may be dropped, less first: of triangles the smallest instances; of all else, which instances share,
    all of the kinds whose largest is smallest.
    """
    if name == "triangles":
        order = np.argsort(pixels, kind="stable")
        ends = np.unique(np.linspace(0, len(order), 65)[1:-1].astype(int))
        yield from (order[:end] for end in ends if end)
        return
    own, back = np.unique(kind, return_inverse=True)
    largest = np.zeros(len(own))
    np.maximum.at(largest, back, pixels)
    rank = np.empty(len(own), int)
    rank[np.argsort(largest, kind="stable")] = np.arange(len(own))
    for end in np.unique(np.linspace(0, len(own), 65)[1:-1].astype(int)):
        if end:
            yield np.flatnonzero(rank[back] < end)


def _named(kinds: Sequence[Kind], kind: Array) -> str:
    """Return how many of what instances are, those that are most first."""
    found = Counter(kinds[k].label for k in kind.tolist()).most_common()
    words = [f"{count} of {label}" for label, count in found[:_NAMED]]
    return ", ".join(words) + (f" and {len(found) - _NAMED} more kinds" if len(found) > _NAMED else "")
