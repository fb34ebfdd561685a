"""The distinct shapes of a scene: which table answers each, and its lattice at a level of detail, computed once."""

from __future__ import annotations

import difflib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from solver.arrays import Floats
from solver.contract import InvalidInput, Shade, Solver, SolverError
from solver.resting import Body
from store.errors import StoreError
from store.lookup import ShapeTable
from store.shape import Shape

from .. import vocabulary
from ..errors import InvalidQuery, ServiceError, Wrong
from ..formats import mesh
from ..limits import waited
from ..shapes.asking import beyond, choose, preset_of, words_of
from ..shapes.live import LiveTables
from ..shapes.query import parse
from .errors import InvalidScene
from .meshes import STEPS
from .request import Item

__all__ = ["COARSE", "Kind", "distinct"]

#: Colatitudes of the lattice that says how far a shape reaches and what hides behind it.
COARSE = 16
#: Share of the least radius of the coarse lattice that surely is within the shape, between its samples too.
_WITHIN = 0.9


@dataclass(eq=False)
class Kind:
    """One shape of one table: its point, its stage, its skin, and what of it has been computed.

    `curve` are seconds and stages, the first of which is the stage; empty where nothing changes.
    """

    solver: Solver
    table: ShapeTable
    point: dict[str, float]
    stage: float
    shade: tuple[str, Shade]
    label: str
    curve: tuple[tuple[float, float], ...] = ()
    shapes: dict[int, Shape] = field(default_factory=dict)
    spent: dict[int, float] = field(default_factory=dict)

    def shape(self, n: int) -> Shape:
        """Return the shape on the lattice of n colatitudes."""
        if n not in self.shapes:
            waited.check()
            start = time.thread_time()
            self.shapes[n] = self.table.at(self.point, self.stage, resolution=n)
            self.spent[n] = time.thread_time() - start
        return self.shapes[n]

    def later(self, n: int) -> list[Shape]:
        """Return the shapes on the curve after the first, on the lattice of n colatitudes."""
        start = time.thread_time()
        found = [self.table.at(self.point, stage, resolution=n) for _, stage in self.curve[1:]]
        self.spent[n] = self.spent.get(n, 0.0) + time.thread_time() - start
        return found

    @cached_property
    def coarse(self) -> Floats:
        """Points (v, 3) of the coarse lattice and the poles [r1]."""
        found: Floats = mesh.vertices(*mesh.surface(self.shape(COARSE))).astype(float)
        return found

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Radii of balls about the origin: within the shape, and around it [r1]."""
        r = np.linalg.norm(self.coarse, axis=1)
        low, high = float(r.min()), float(r.max())
        for shape in self.later(COARSE):
            r = np.linalg.norm(mesh.vertices(*mesh.surface(shape)), axis=1)
            low, high = min(low, float(r.min())), max(high, float(r.max()))
        return _WITHIN * low, 1.03 * high

    @cached_property
    def extent(self) -> float:
        """Largest coordinate [r1] that counts when positions are rounded: that of the fresh shape, which needs no
        look-up and which drying does not pass.
        """
        angles = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, 2 * np.pi, 32, endpoint=False), indexing="ij")
        return 1.08 * float(np.abs(self.table.fresh(self.point).points(*angles)).max())

    @property
    def step(self) -> float:
        """Length [r1] of one step of a rounded position."""
        return self.extent / STEPS

    @property
    def dryness(self) -> float:
        """Share of the way from the fresh shape to the table's last stage."""
        low, high = self.table.reach
        last = high if abs(high) >= abs(low) else low
        return min(abs(self.stage / last), 1.0) if last else 0.0

    @property
    def body(self) -> Body:
        """The shape for piles [1/r1]."""
        return Body(mesh.vertices(*mesh.surface(self.shape(32))).astype(float))


def distinct(items: Sequence[Item], tables: LiveTables, highest: int) -> tuple[list[Kind], list[int]]:
    """Return the distinct kinds of a scene, and for each item which of them it is. Nothing is computed.

    Raises:
        InvalidScene: listing every item that no table holds, with what to change.

    """
    numbers: dict[tuple[object, ...], int] = {}
    kinds: list[Kind] = []
    rows: list[int] = []
    wrong: list[Wrong] = []
    only: str | None = None
    for i, item in enumerate(items):
        key = (item.solver, item.preset, tuple(sorted(item.parameters.items())), item.stage, item.curve, item.shade)
        number = numbers.get(key)
        if number is None:
            numbers[key] = number = len(kinds)
            try:
                if item.solver is None and only is None:
                    only = _only(tables)  # reads what all tables say of themselves: once
                kinds.append(_kind(item, item.solver or only or "", tables, highest))
            except InvalidQuery as error:
                wrong += [Wrong(f"items.{i}.{one.name}", one.detail, one.advice) for one in error.wrong]
            except (StoreError, SolverError, ServiceError) as error:
                wrong.append(Wrong(f"items.{i}", error.message.rstrip("."), error.advice))
            if wrong:
                numbers[key] = -1
        rows.append(number)
        if len(wrong) > 20:
            break
    if wrong:
        raise InvalidScene.of(wrong)
    return kinds, rows


def _kind(item: Item, name: str, tables: LiveTables, highest: int) -> Kind:
    solver = vocabulary.solver_named(name)
    preset = preset_of(solver, item.preset)
    symbol = solver.stages.symbol
    said = {**item.parameters, symbol: item.first}
    found = choose(tables.families(solver), said, symbol, preset)
    table = tables.get(found.name)
    words = words_of(solver, table, highest)
    query = parse([(k, repr(v)) for k, v in said.items()], words, [], found.filled, beyond(found, words))
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
    return Kind(solver, table, dict(query.point), query.stage, _shade(solver, item), label, item.curve)


def _only(tables: LiveTables) -> str:
    """Return the solver that the store's tables are of.

    Raises:
        InvalidInput: there are none, or of several.

    """
    found = tables.solvers()
    if len(found) != 1:
        advice = f"Name one: {', '.join(found)}." if found else "Build a table first."
        raise InvalidInput(f"the tables are of {len(found)} solvers, and the item names none.", advice=advice)
    return found[0]


def _shade(solver: Solver, item: Item) -> tuple[str, Shade]:
    """Return the skin of an item: the one it names, else the one whose name begins its preset's, else the plainest.

    Raises:
        InvalidInput: there is no skin of that name.

    """
    shades = solver.looks.shades
    if item.shade is not None:
        if item.shade not in shades:
            near = difflib.get_close_matches(item.shade, list(shades), n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise InvalidInput(
                f"{solver.name} has no skin {item.shade!r}.", advice=f"{hint}Known: {', '.join(shades)}."
            )
        return item.shade, shades[item.shade]
    for name, shade in shades.items():
        if item.preset is not None and item.preset.startswith(name):
            return name, shade
    if not shades:
        plain = ("#b8aea2", "#8d8278")
        return "plain", Shade(plain, plain, (0.6, 0.7))
    return list(shades.items())[-1]
