"""Figs. 7 to 10 and Table 1 of Liu et al. 2014, drawn from the tables that come with wizen.

    python -m benchmarks.dehydration.claims.panels [FOLDER]

Writes fig7.png to fig10.png at s = 0.3 and table1.png at s = 0.1, 0.2 and 0.3; FOLDER is docs/ if none is given.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Mapping
from pathlib import Path

from PIL import Image

from benchmarks.figures import ROOT
from service.scenes.kinds import distinct
from service.scenes.request import Item
from service.shapes.live import LiveTables
from store import starter
from sweeps.pictures.sheet import Panel, sheet

from .shown import FIGURES, FRUITS, SKINS

#: Colatitudes of the lattice that is drawn.
_FINE = 192
#: A picture of 16 panels of one skin stays below 200 kB with so many colours; of six skins, 18 do.
_COLOURS, _MANY = 96, 240


def main(folder: Path) -> None:
    tables = LiveTables(starter.ROOT, 60.0)
    for name, (title, axis, fruit) in FIGURES.items():
        rows = [[_panel(tables, 0.3, fruit(te, x)) for x in axis] for te in reversed(SKINS)]
        labels = {"column_labels": [f"{x:g}" for x in axis], "row_labels": [f"te {te:g}" for te in reversed(SKINS)]}
        _write(folder / f"{name}.png", sheet(rows, column_title=title, pixels=180, **labels))
    stages = (0.1, 0.2, 0.3)
    fruits = [[_panel(tables, s, {}, preset) for preset in FRUITS] for s in stages]
    picture = sheet(fruits, column_labels=FRUITS, row_labels=[f"s = {s:g}" for s in stages], pixels=190)
    _write(folder / "table1.png", picture, _MANY)


def _panel(tables: LiveTables, stage: float, parameters: Mapping[str, float], preset: str | None = None) -> Panel:
    item = Item(solver="dehydration", preset=preset, parameters=dict(parameters), stage=stage)
    (kind,), _ = distinct([item], tables, _FINE)
    shape = kind.shape(_FINE)
    assert shape.position is not None
    return Panel(shape.position, shape.poles, worn=None if preset is None else kind.skin)


def _write(path: Path, data: bytes, colours: int = _COLOURS) -> None:
    image = Image.open(io.BytesIO(data)).convert("RGB").quantize(colours)
    image.save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs")
