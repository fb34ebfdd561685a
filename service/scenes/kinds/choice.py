"""Which kinds the items of a scene are: each distinct one once. Tables compute nothing yet; stored runs are read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np

from solver import registry
from solver.contract import InvalidInput, SolverError
from store.errors import StoreError

from ... import vocabulary
from ...errors import InvalidQuery, ServiceError, Wrong
from ...shapes.asking import beyond, choose, preset_of, words_of
from ...shapes.live import LiveTables
from ...shapes.query import parse
from ..errors import InvalidScene
from ..request import Item
from .kind import Kind
from .looked import Looked
from .runs import Missing, Runs, Together, find
from .shades import shade_of

__all__ = ["distinct"]

#: Lowest and highest.
Range = tuple[float, float]


def distinct(
    items: Sequence[Item], tables: LiveTables, highest: int, runs: Runs | None = None
) -> tuple[list[Kind], list[tuple[int, ...]]]:
    """Return the distinct kinds of a scene, and for each item which of them its individuals are, in turns. No table is
    asked yet.

    Runs are those of the tables' store, and nobody asks for those that it lacks, unless `runs` says so.

    Raises:
        InvalidScene: listing every item that neither tables nor runs are for, with what to change.

    """
    runs = runs or Runs(lambda: tables.store, lambda asked: (None, "Ask for it with POST /v1/jobs."))
    together = Together(items)
    numbers: dict[tuple[object, ...], tuple[int, ...]] = {}
    kinds: list[Kind] = []
    rows: list[tuple[int, ...]] = []
    wrong: list[Wrong] = []
    for i, item in enumerate(items):
        # True equals 1, and is no number
        values: object = tuple((name, type(value) is bool, value) for name, value in sorted(item.parameters.items()))
        of_run = item.run, item.source, item.quality, item.full
        unlike = (item.differ, item.shapes, item.seed) if item.differ else None
        key = (item.solver, item.preset, values, item.stage, item.curve, item.shade, of_run, unlike, item.variants)
        try:
            number = numbers.get(key)
        except TypeError:  # lists among the parameters; rare, where items are many
            key = (*key[:2], json.dumps(item.parameters, sort_keys=True), *key[3:])
            number = numbers.get(key)
        if number is None:
            try:
                found = _kinds_of(item, tables, highest, runs, together)
            except (StoreError, SolverError, ServiceError) as error:
                wrong += _complaints(error, f"items.{i}")
                found = []
            numbers[key] = number = tuple(range(len(kinds), len(kinds) + len(found)))
            kinds += found
        if item.size == "real" and not wrong:
            wrong += _measured(item, [kinds[k] for k in number], f"items.{i}.size")
        rows.append(number)
        if len(wrong) > 20:
            break
    if wrong:
        raise InvalidScene.of(wrong)
    return kinds, rows


def _kinds_of(item: Item, tables: LiveTables, highest: int, runs: Runs, together: Together) -> list[Kind]:
    """Return the kinds of an item: one, or as many as its individuals differ by; each with its variants."""
    given = item
    if item.solver is None and item.run is None:
        item = item.model_copy(update={"solver": _solver_of(item, tables)})
    if _is_run(item, tables):
        if item.differ:
            advice = "Leave it out, or name several runs."
            raise InvalidQuery.of([Wrong("differ", "is of tables: a run is what it is", advice)])
        stages = () if item.run is not None else together.stages(given)
        found = _of_run(item, runs, stages)
        found.variants = tuple(_of_run(one, runs, stages) for one in _variants(item))
        return [found]
    made: list[Kind] = [*_of_table(item, tables, highest)]
    for one in _variants(item):
        for kind, other in zip(made, _of_table(one, tables, highest), strict=True):
            kind.variants += (other,)
    return made


def _variants(item: Item) -> list[Item]:
    return [item.model_copy(update={"stage": stage, "variants": ()}) for stage in item.variants]


def _complaints(error: StoreError | SolverError | ServiceError, name: str) -> list[Wrong]:
    """Return what is wrong with an item, by what of it is."""
    if isinstance(error, ServiceError) and error.wrong:
        return [Wrong(f"{name}.{one.name}", one.detail, one.advice) for one in error.wrong]
    return [Wrong(name, error.message.rstrip("."), error.advice)]


def _solver_of(item: Item, tables: LiveTables) -> str:
    """Return the solver that an item without one means: the only one with its preset, or else with tables.

    Raises:
        InvalidInput: there is no such solver.

    """
    if item.preset is not None:
        owners = [name for name in registry.names() if item.preset in registry.get(name).presets]
        if len(owners) == 1:
            return owners[0]
    found = tables.solvers()  # reads what all tables say of themselves
    if len(found) != 1:
        advice = f"Name one: {', '.join(found)}." if found else "Name one, or build a table first."
        raise InvalidInput(f"the tables are of {len(found)} solvers, and the item names none.", advice=advice)
    return found[0]


def _is_run(item: Item, tables: LiveTables) -> bool:
    if item.run is not None or item.source is not None:
        return item.run is not None or item.source == "run"
    return item.solver in registry.names() and item.solver not in tables.solvers()


def _of_run(item: Item, runs: Runs, stages: Sequence[float]) -> Kind:
    # these take a while to import, and most scenes are of tables alone
    from .placeholders import placeholder
    from .stored import stored

    found = find(item, runs, stages)
    if not isinstance(found, Missing):
        return stored(runs.store(), found, item)
    if item.shade is not None:
        shade_of(found.solver, item.shade, item.preset)  # says which there are
    return placeholder(found, item.preset or found.solver.name, item.stages)


def _of_table(item: Item, tables: LiveTables, highest: int) -> list[Looked]:
    solver = vocabulary.solver_named(item.solver or "")
    if item.quality is not None:
        advice = "Leave it out, or say source = 'run'."
        raise InvalidQuery.of([Wrong("quality", "is of runs: what tables hold was run already", advice)])
    if item.full:
        raise InvalidQuery.of([Wrong("full", "is of runs: nothing stands on what tables hold", "Leave it out.")])
    preset = preset_of(solver, item.preset)
    symbol = solver.stages.symbol
    said = {**_numbers(item), symbol: item.first}
    found = choose(tables.families(solver), said, symbol, preset)
    table = tables.get(found.name)
    words = words_of(solver, table, highest, tables)
    query = parse([(k, repr(v)) for k, v in said.items()], words, [], found.filled, beyond(found, words), preset, ())
    if query.outside:
        raise InvalidQuery.of(query.outside)
    low, high = words.stages
    for at, stage in item.curve:
        if not low <= stage <= high:
            detail = f"{stage:g} at {at:g} s is off the table's {words.say(symbol)}"
            raise InvalidQuery.of([Wrong("curve", detail, f"Take stages from {words.say(symbol)}.")])
    table.fresh(query.point)  # says what no shape can be
    last = f"..{item.curve[-1][1]:g}" if item.curve else ""
    label = f"{item.preset or table.info.name} {symbol}={item.first:g}{last}"
    shade = shade_of(solver, item.shade, item.preset)
    first = Looked(solver, table, dict(query.point), query.stage, shade, label, item.curve)
    return _differing(first, item, words.axes, words.stages) if item.differ else [first]


def _differing(first: Looked, item: Item, axes: Mapping[str, Range], reach: Range) -> list[Looked]:
    """Return shapes of points and stages about one: each moved by up to the item's share, and held within the table's
    ranges. Points that no fruit can have move half as far, until they can.
    """
    random = np.random.default_rng([item.seed or 0, 7])
    found = [first]
    for _ in range(item.shapes - 1):
        by = item.differ * random.uniform(-1, 1, len(axes) + 1)
        while True:
            point = {
                name: first.point[name]
                if name not in axes
                else _within(first.point[name] * (1 + by[1 + list(axes).index(name)]), axes[name])
                for name in first.point
            }
            try:
                first.table.fresh(point)
            except SolverError:
                by[1:] *= 0.5 if np.abs(by[1:]).max() > 1e-3 else 0.0
                continue
            break
        curve = tuple((at, _within(stage * (1 + by[0]), reach)) for at, stage in first.curve)
        stage = curve[0][1] if curve else _within(first.stage * (1 + by[0]), reach)
        found.append(Looked(first.solver, first.table, point, stage, first.shade, first.label, curve))
    return found


def _within(value: float, ends: Range) -> float:
    """Return a value no farther out than the ends of a range, in four digits: equal shapes are to be equal."""
    low, high = ends
    rounded = float(f"{value:.4g}")
    return rounded if low <= rounded <= high else min(max(value, low), high)


def _numbers(item: Item) -> dict[str, float]:
    """Return the parameters of an item of a table.

    Raises:
        InvalidQuery: some are no numbers.

    """
    found, wrong = dict[str, float](), []
    for name, value in item.parameters.items():
        try:
            if isinstance(value, bool) or not isinstance(value, float | int):
                advice = "Take a number, or say source = 'run'."
                wrong.append(Wrong(f"parameters.{name}", "a table is asked by numbers", advice))
            else:
                found[name] = float(value)
        except OverflowError:
            wrong.append(Wrong(f"parameters.{name}", "is beyond all measure", "Take a number that a table holds."))
    if wrong:
        raise InvalidQuery.of(wrong)
    return found


def _measured(item: Item, kinds: Sequence[Kind], name: str) -> list[Wrong]:
    """Find how large an item's kinds are in metres; return what is wrong where nobody knows."""
    advice = "Say how many units of the scene its own unit is: size = 1.0."
    for kind in kinds:
        if isinstance(kind, Looked) and kind.metres is None:
            params = kind.solver.parse(item.parameters, item.preset)
            kind.metres = kind.solver.metres(params.model_dump(mode="json"))
        if kind.metres is None:
            return [Wrong(name, f"nobody knows how large {kind.label} is", advice)]
    return []
