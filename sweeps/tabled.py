"""Shapes of one solver for runs of another that want only those: from the tables that come with wizen, in milliseconds.

Solvers know no store: they ask through `Context.shape`. It is always these tables, so that the same
parameters give the same bytes wherever they are solved.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from solver.arrays import Floats
from solver.contract import InvalidInput

if TYPE_CHECKING:
    from store.families.choose import Families
    from store.lookup import ShapeTable

__all__ = ["shape"]


def shape(solver: str, point: Mapping[str, float], stage: float, resolution: int) -> Floats:
    """Return the displacement (n, 2 n, 3) on the lattice at a point, named by the axes of `solver`, and a stage.

    Raises:
        InvalidInput: there is no table of that solver, or the point or the stage lies outside of it.

    """
    from store.errors import OutsideTable

    try:
        table, filled = _table(solver, tuple(point.items()), stage)
        found = table.at({**filled, **point}, stage, resolution=resolution, fields=("displacement",))
    except OutsideTable as error:
        raise InvalidInput(f"no shape of {solver}: {error.message}", advice=error.advice) from error
    assert found.displacement is not None
    return np.asarray(found.displacement, float)


def _table(solver: str, point: tuple[tuple[str, float], ...], stage: float) -> tuple[ShapeTable, Mapping[str, float]]:
    """Return the table that holds a point, or the nearest one, which says what it does not hold; and the values of
    axes that are not named.
    """
    families = _families(solver)
    info = (families.choose(dict(point), stage) or families.nearest(dict(point), stage)[0]).info
    return _open(info.name), families.filled(info)


@cache
def _families(solver: str) -> Families:
    from solver import registry
    from store import starter
    from store.errors import UnknownTable
    from store.families import stored
    from store.store import Store

    try:
        return stored.families(Store.open(starter.ROOT), registry.get(solver))
    except UnknownTable:
        raise InvalidInput(f"no table of {solver} comes with wizen.", advice="Solve that shape itself.") from None


@cache
def _open(name: str) -> ShapeTable:
    from store import starter
    from store.lookup import ShapeTable
    from store.store import Store

    return ShapeTable.open(Store.open(starter.ROOT), name)
