"""A table as the source of its next generation, where its runs are not here: fewer waves, or another precision.

What the runs told by stage stands in the table; all that look-ups want to know besides follows from its spectra.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..manifest import TableInfo
from . import generation
from .generate import Source, Taken
from .samples import Samples

__all__ = ["source"]


def source(path: Path, table: TableInfo) -> Source:
    """Return the generation of `table` in `path`, which must have been verified, as a source.

    Raises:
        CorruptTable: it cannot be read.

    """
    columns = generation.read(path, table.places)
    values = tuple({name: float(columns[name].values[i]) for name in table.places} for i in range(table.samples))
    samples = Samples(
        keys=table.keys,
        values=values,
        axes=table.places,
        fixed=table.fixed,
        template=table.template,
        need=table.need,
        version=table.version,
        tied=table.tied,
    )
    with generation.open(path) as opened:
        told = opened["spectrum"].attrs
        lost = float(told.get("rms_loss", 0.0)), float(told.get("max_loss", 0.0))
    return Source(samples, lambda band: _taken(path, band), lost)


def _taken(path: Path, band: int) -> Iterator[Taken]:
    judged = (*generation.left_out_names(), *generation.skipped_names())
    with generation.open(path) as opened:
        rows = {str(n): v.variable.load() for n, v in opened.data_vars.items() if v.dims == generation.ROWS}
    rows = {name: row for name, row in rows.items() if name not in judged}
    for i, block in enumerate(generation.map_spectra(path)):
        waves = np.ascontiguousarray(block[..., : band + 1, : band + 1, :], np.float64)
        yield Taken({name: row.isel(sample=i) for name, row in rows.items()}, waves)
