"""Dried shapes for solvers that want only shape: from the table that comes with wizen, in milliseconds.

Solvers know no store: they ask through `Context.dried`. It is always this table, which belongs to the version, so that
the same parameters give the same bytes wherever they are solved.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from solver.arrays import Floats
from solver.contract import InvalidInput

if TYPE_CHECKING:
    from store.lookup import ShapeTable

__all__ = ["dried"]


def dried(fruit: Mapping[str, float], shrinkage: float, resolution: int) -> Floats:
    """Return the displacement (n, 2 n, 3) [r1] on the lattice of a fruit, named by the axes of dehydration.

    Raises:
        InvalidInput: the fruit or the shrinkage lies outside the table.

    """
    from store.errors import OutsideTable

    try:
        shape = _table().at(fruit, shrinkage, resolution=resolution, fields=("displacement",))
    except OutsideTable as error:
        raise InvalidInput(f"no dried shape: {error.message}", advice=error.advice) from error
    assert shape.displacement is not None
    return np.asarray(shape.displacement, float)


@cache
def _table() -> ShapeTable:
    from store import starter
    from store.lookup import ShapeTable

    return ShapeTable.open(starter.ROOT)
