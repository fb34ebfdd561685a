"""Figs. 7 to 10 and Table 1 of Liu et al. 2014, drawn from the tables that come with wizen.

    python -m benchmarks.dehydration.claims.panels [FOLDER]

Writes fig7.png to fig10.png at s = 0.3 and table1.png at s = 0.1, 0.2 and 0.3; FOLDER is docs/ if none is given.
"""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PIL import Image

from benchmarks.figures import ROOT
from service.scenes.kinds import distinct
from service.scenes.request import Item
from service.shapes.live import LiveTables
from store import starter
from sweeps.pictures.sheet import Panel, sheet

from .shown import GAMMAS, LENGTHS, RADII, SKINS, WAISTS

#: Colatitudes of the lattice that is drawn.
_FINE = 192
_FRUITS = ("raisin", "wolfberry", "jujube1", "jujube2", "plum1", "plum2")
#: A picture of 16 panels stays below 200 kB with so many colours.
_COLOURS = 96


def sphere(te: float, gamma: float) -> dict[str, float]:
    return {"te": te, "gamma": gamma, "rs1": 0.4, "rs2": 0.4}


def stone(te: float, radius: float) -> dict[str, float]:
    return {"te": te, "gamma": 10, "rs1": radius, "rs2": radius}


def long_stone(te: float, length: float) -> dict[str, float]:
    return {"te": te, "gamma": 10, "rs1": length, "rs2": 0.4}


def prolate(te: float, r4: float) -> dict[str, float]:
    """An ellipse with half-axes 1 (along the poles) and r4, at every 30 degrees."""
    r2, r3 = (round(1 / math.hypot(math.cos(a), math.sin(a) / r4), 4) for a in (math.pi / 6, math.pi / 3))
    radii = {"r2": r2, "r3": r3, "r4": r4, "r5": r3, "r6": r2, "r8": r4}
    return {"te": te, "gamma": 10, "rs1": 0.3, "rs2": 0.3, **radii}


FIGURES: dict[str, tuple[str, tuple[float, ...], Any]] = {
    "fig7": ("stiffness of the skin, gamma", tuple(map(float, GAMMAS)), sphere),
    "fig8": ("radius of the stone [r1]", RADII, stone),
    "fig9": ("length of the stone [r1]", LENGTHS, long_stone),
    "fig10": ("radius at the equator [r1]", WAISTS, prolate),
}


def main(folder: Path) -> None:
    tables = LiveTables(starter.ROOT, 60.0)
    for name, (title, axis, fruit) in FIGURES.items():
        rows = [[_panel(tables, 0.3, fruit(te, x)) for x in axis] for te in reversed(SKINS)]
        labels = {"column_labels": [f"{x:g}" for x in axis], "row_labels": [f"te {te:g}" for te in reversed(SKINS)]}
        _write(folder / f"{name}.png", sheet(rows, column_title=title, pixels=180, **labels))
    stages = (0.1, 0.2, 0.3)
    fruits = [[_panel(tables, s, {}, preset) for preset in _FRUITS] for s in stages]
    picture = sheet(fruits, column_labels=_FRUITS, row_labels=[f"s = {s:g}" for s in stages], pixels=190)
    _write(folder / "table1.png", picture)


def _panel(tables: LiveTables, stage: float, parameters: Mapping[str, float], preset: str | None = None) -> Panel:
    item = Item(solver="dehydration", preset=preset, parameters=dict(parameters), stage=stage)
    (kind,), _ = distinct([item], tables, _FINE)
    shape = kind.shape(_FINE)
    assert shape.position is not None
    return Panel(shape.position, shape.poles)


def _write(path: Path, data: bytes) -> None:
    image = Image.open(io.BytesIO(data)).convert("RGB").quantize(_COLOURS)
    image.save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs")
