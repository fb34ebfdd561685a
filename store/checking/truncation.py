"""What a table's band limit and precision cost: its displacements against those of the runs it was built of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from ..blending.blend import complex_view
from ..generations import generation
from ..store import Store
from ..surfaces import harmonics, spectra
from ..tables import TableInfo, path_of

__all__ = ["Loss", "losses"]


class Loss(NamedTuple):
    """Root mean square over surface and samples, and largest, distance of a stage from the runs [r1]."""

    stage: float
    rms: float
    max: float


def losses(store: Store, table: TableInfo, before: TableInfo | None = None) -> list[Loss]:
    """Compare a generation with the results behind it on their own lattice, one sample in memory at a time.

    Where there are no results any more, `before` is the generation to compare it with.

    Raises:
        FileNotFoundError, CorruptTable: the generation's file is gone or damaged.
        UnknownJob, CorruptShard: a result is.

    """
    n = int(table.need["resolution"])
    area = harmonics.area(n)
    stored = generation.map_spectra(path_of(store, table))
    runs = (_displacement(store, key) for key in table.keys)
    if before is not None:
        runs = (_synthesized(block, n) for block in generation.map_spectra(path_of(store, before)))
    squares, worst = np.zeros(len(table.stages)), np.zeros(len(table.stages))
    for run, block in zip(runs, stored, strict=True):
        square = ((_synthesized(block, n) - run) ** 2).sum(axis=1)
        squares += (area * square).sum(axis=(1, 2)) / len(table.keys)
        worst = np.maximum(worst, square.max(axis=(1, 2)))
    rows = zip(table.stages, np.sqrt(squares).tolist(), np.sqrt(worst).tolist(), strict=True)
    return [Loss(*row) for row in rows]


def _displacement(store: Store, key: str) -> Array:
    return store.get(key)["displacement"].transpose("stage", "component", "colatitude", "azimuth").values


def _synthesized(block: Array, n: int) -> Array:
    return spectra.synthesize(complex_view(block).astype(np.complex128), n)
