"""Buckling maps: what a table holds, drawn over two of its axes, or along the stages."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from solver.contract import InvalidGeometry, Shade, dryness
from store import tables
from store.lookup import ShapeTable
from store.store import Store

from ..errors import InvalidOption
from ..planning.planfile import suggest
from .sheet import Panel, sheet

__all__ = ["Map"]

#: Values drawn along an axis: the samples' own if there are no more than this, else as many evenly spaced ones.
_MOST = 7
#: Rows of a map by stages; more make a picture that nobody can print.
_MOST_ROWS = 60


class Map:
    """Draws one table. `given` fixes axes that are not drawn; `units` of the axes are written at the edges; `shade` is
    the skin of its fruits, a dried jujube's if not given.
    """

    def __init__(
        self,
        store: Store,
        table: ShapeTable,
        units: Mapping[str, str],
        given: Mapping[str, Any],
        pixels: int,
        shade: Shade | None = None,
    ) -> None:
        self._shade = shade
        self._table, self._units, self._given, self._pixels = table, units, given, pixels
        with tables.open(store, table.info.name) as opened:
            self._sampled = {name: np.unique(opened[name].values.astype(float)) for name in table.axes}
        self.count = 0

    def by_axes(self, x: str | None, y: str | None, stage: float) -> bytes:
        """Return a PNG with `x` to the right and `y` upwards; by default gamma and te, or the first two axes.

        Raises:
            InvalidOption: an axis that the table does not have.
            OutsideTable: other axes are neither drawn nor given, or the stage is out of reach.

        """
        x, y = self._choose(x, y)
        columns, rows = self._points(x), list(reversed(self._points(y)))
        return sheet(
            [[self._panel({**column, **row}, stage) for column in columns] for row in rows],
            title=f"{self._table.info.solver} at s = {stage:g}{self._said()}",
            column_labels=[self._label(column) for column in columns] if x else (),
            row_labels=[self._label(row) for row in rows] if y else (),
            pixels=self._pixels,
        )

    def by_stages(self, stages: tuple[float, ...]) -> bytes:
        """Return a PNG with a row of stages for every combination of the axes' values.

        Raises:
            InvalidOption: more rows than a picture can hold.
            OutsideTable: a stage is out of reach.

        """
        free = [name for name in self._table.axes if name not in self._given]
        rows = [
            {name: value for axis in point for name, value in axis.items()}
            for point in itertools.product(*(self._points(name) for name in free))
        ]
        if len(rows) > _MOST_ROWS:
            raise InvalidOption(f"the map would have {len(rows)} rows.", "Fix some axes with --set.")
        return sheet(
            [[self._panel(row, stage) for stage in stages] for row in rows],
            title=f"{self._table.info.solver}{self._said()}",
            column_labels=[f"s = {stage:g}" for stage in stages],
            row_labels=[self._label(row) for row in rows],
            pixels=self._pixels,
        )

    def _choose(self, x: str | None, y: str | None) -> tuple[str | None, str | None]:
        axes = self._table.axes
        for option, name in (("--x", x), ("--y", y)):
            if name is not None and name not in axes:
                raise InvalidOption(f"{option} {name}: the table has no such axis.", suggest(name, axes))
        if x is not None and x == y:
            raise InvalidOption(f"--x and --y are both {x}.", "Name two different axes.")
        # gamma to the right and te upwards are the axes of the paper's map
        free = [name for name in axes if name not in (x, y, *self._given)]
        free.sort(key=lambda name: name != "gamma")
        x = x or (free.pop(0) if free else None)
        free.sort(key=lambda name: name != "te")
        y = y or (free.pop(0) if free else None)
        return x, y

    def _points(self, name: str | None) -> list[dict[str, float]]:
        """Return the values drawn along an axis, each with its name; one without any for no axis."""
        if name is None:
            return [{}]
        values = self._sampled[name]
        if len(values) > _MOST:
            values = np.linspace(values[0], values[-1], _MOST)
        return [{name: float(value)} for value in values]

    def _panel(self, point: Mapping[str, float], stage: float) -> Panel | None:
        try:
            shape = self._table.at({**self._given, **point}, stage)
        except InvalidGeometry:
            return None
        self.count += 1
        assert shape.position is not None  # asked for by default
        number = shape.descriptors.get("buckle_count")
        note = "" if number is None or stage == 0 else f"{number:.0f} buckles"
        worn = None if self._shade is None else self._shade.worn(dryness(stage, self._table.reach))
        return Panel(shape.position, shape.poles, note, worn=worn)

    def _label(self, point: Mapping[str, float]) -> str:
        units = {name: self._units.get(name, "1") for name in point}
        return "\n".join(
            f"{name} = {value:g}{'' if units[name] == '1' else ' ' + units[name]}" for name, value in point.items()
        )

    def _said(self) -> str:
        return "".join(f", {name} = {value}" for name, value in self._given.items())
