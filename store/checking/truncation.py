"""What a table's band limit and precision cost: its displacements against those of the runs it was built of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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


def losses(store: Store, table: TableInfo) -> list[Loss]:
    """Compare a generation with the results behind it on their own lattice, one sample in memory at a time.

    Raises:
        FileNotFoundError, CorruptTable: the generation's file is gone or damaged.
        UnknownJob, CorruptShard: a result is.

    """
    n = int(table.need["resolution"])
    area = harmonics.area(n)
    stored = generation.map_spectra(path_of(store, table))
    squares, worst = np.zeros(len(table.stages)), np.zeros(len(table.stages))
    for key, block in zip(table.keys, stored, strict=True):
        run = store.get(key)["displacement"].transpose("stage", "component", "colatitude", "azimuth").values
        kept = spectra.synthesize(complex_view(block).astype(np.complex128), n)
        square = ((kept - run) ** 2).sum(axis=1)
        squares += (area * square).sum(axis=(1, 2)) / len(table.keys)
        worst = np.maximum(worst, square.max(axis=(1, 2)))
    rows = zip(table.stages, np.sqrt(squares).tolist(), np.sqrt(worst).tolist(), strict=True)
    return [Loss(*row) for row in rows]
