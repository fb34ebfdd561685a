"""What the tables of shapes in a store cover, for people who look for something to ask: numbers and a picture."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver import registry
from solver.contract import InvalidGeometry, Shade, Solver, dryness
from store.errors import UnknownTable
from store.families import stored
from store.families.choose import Families
from store.generations import generation
from store.lookup import ShapeTable
from store.store import Store
from store.tables import TableInfo, path_of

__all__ = ["Said", "covered", "drawn", "gallery", "portrait", "said", "shade", "thumbnail"]

#: Share of the way to the last stage at which a family's picture is taken: wrinkled, and not yet crumpled.
_DRY = 0.67
#: Pixels of a family's picture; pictures in a row of the gallery, and pixels of each.
_PIXELS, _COLUMNS, _LARGE = 160, 5, 240


def covered(store: Store, families: Families, info: TableInfo, solver: Solver) -> dict[str, Any]:
    """Return what a table covers as JSON values.

    Per stage: how many of the samples converged, and the median error of the roughness with every sample predicted
    from the others, null where nobody knows.

    Raises:
        CorruptTable, FileNotFoundError: its generation cannot be read.

    """
    path = path_of(store, info)
    kept, units, values = _kept(path), solver.axis_units(), stored.values(store, info)
    return {
        "name": info.name,
        "solver": info.solver,
        "version": info.version,
        "is_current": solver.answers_from(info.version),
        "quality": info.need.get("quality"),
        "samples": info.samples,
        "resolution": info.resolution,
        "bytes": path.stat().st_size,
        "axes": {
            name: {"lowest": low, "highest": high, "values": values[name], "units": units.get(name, "1")}
            for name, (low, high) in info.axes.items()
        },
        "tied": {name: tie.leader for name, tie in info.tied.items()},
        "fixed": {name: v for name, v in info.fixed.items() if name in info.places},
        "made": stored.made(info, solver),
        "stages": [
            {
                "stage": stage,
                "converged": None if kept.converged is None else kept.converged[j],
                "roughness_error": None if kept.off is None else round(kept.off[j], 4),
                "neighbour_correlation": None if kept.likeness is None else round(kept.likeness[j], 4),
            }
            for j, stage in enumerate(info.stages)
        ],
        "method": kept.method,
        "presets": families.presets_of(info),
        "has_plan": bool(info.plan),
    }


class _Kept(NamedTuple):
    """What a generation holds by stage: samples that converged, median error of the roughness, likeness of neighbours;
    and the method that the error is of.
    """

    converged: list[int] | None
    off: list[float] | None
    likeness: list[float] | None
    method: str | None


@lru_cache(maxsize=256)
def _kept(path: Path) -> _Kept:
    # a generation's file never changes, and opening its columns takes longer than a shape
    opened = generation.read(path, ("converged", "neighbour_correlation", *generation.left_out_names()))
    judged, likeness = generation.left_out(opened), opened.get("neighbour_correlation")
    return _Kept(
        opened["converged"].values.astype(bool).sum(axis=0).tolist() if "converged" in opened else None,
        None if judged is None else np.median(np.abs(judged[0][..., 0] - 1), axis=0).tolist(),
        None if likeness is None else likeness.values.tolist(),
        None if judged is None else judged[1],
    )


class Said(NamedTuple):
    """What files say of a table's shapes: numbers that are the same in all of it, how its runs were done where that is
    not the usual, and the units of its parameters and of the stage.
    """

    fixed: Mapping[str, float]
    made: Mapping[str, Any]
    units: Mapping[str, str]


def said(solver: Solver, info: TableInfo) -> Said:
    """Return what files say of the shapes of a table, in the words of answers over HTTP."""
    # entries that no axis reaches are no names, and what is no number is said as how the runs were done
    fixed = {k: float(v) for k, v in info.fixed.items() if k.isidentifier() and isinstance(v, int | float)}
    known, stage = solver.axis_units(), solver.stages
    units = {name: known[name] for name in (*info.axes, *info.tied, *fixed) if name in known}
    return Said(fixed, stored.made(info, solver), {**units, stage.symbol: stage.units})


def portrait(store: Store, families: Families, info: TableInfo) -> tuple[dict[str, float], float]:
    """Return the point and the stage at which a table is shown: its preset's, else its middle sample's."""
    stage = min(info.stages, key=lambda s: abs(abs(s) - _DRY * max(map(abs, info.stages))))
    presets = families.presets_of(info)
    if presets:
        preset = info.name if info.name in presets else presets[0]
        known = families.values({}, preset)
        if info.axes.keys() <= known.keys():
            return {name: float(known[name]) for name in info.axes}, stage
    values = stored.values(store, info)
    return {name: values[name][len(values[name]) // 2] for name in info.axes}, stage


def thumbnail(table: ShapeTable, point: Mapping[str, float], stage: float, presets: Sequence[str]) -> bytes:
    """Return a PNG of a shape, in the colours that its table or its presets are named after.

    Raises:
        InvalidGeometry: no shape has these parameters.

    """
    from PIL import Image

    from .pictures.render import render

    shape = table.at(point, stage, resolution=96)
    assert shape.position is not None  # asked for by default
    named = registry.get(table.info.solver).looks.shade_of((table.info.name, *presets))
    worn = None if named is None else named[1].worn(dryness(stage, table.reach))
    out = io.BytesIO()
    Image.fromarray(render(shape.position, shape.poles, _PIXELS, worn=worn)).save(out, "PNG", optimize=True)
    return out.getvalue()


def drawn(table: ShapeTable, families: Families, store: Store) -> bytes:
    """Return a table's thumbnail at its portrait, or at its middle sample where no shape has the portrait's numbers."""
    point, stage = portrait(store, families, table.info)
    presets = families.presets_of(table.info)
    try:
        return thumbnail(table, point, stage, presets)
    except InvalidGeometry:
        return thumbnail(table, table.sample(table.size // 2), stage, presets)


def gallery(store: Store) -> bytes:
    """Return a PNG with the portraits of all tables of shapes in a store.

    Raises:
        UnknownTable: there is none.

    """
    # what draws takes a fifth of a second to import, and a service's start must not
    from .pictures.sheet import Panel, sheet

    panels = []
    for name in store.table_names():
        table = ShapeTable.open(store, name, surfaces=registry.surface)
        solver = registry.get(table.info.solver)
        families = stored.families(store, solver)
        point, stage = portrait(store, families, table.info)
        shape = table.at(point, stage, resolution=128)
        assert shape.position is not None  # asked for by default
        said = [f"{axis} {value:g}" for axis, value in point.items()]
        skin = shade(solver, table.info, families)
        worn = None if skin is None else skin.worn(dryness(stage, table.reach))
        note = f"{name}: {', '.join([*said, f'{solver.stages.symbol} {stage:g}'])}"
        panels.append(Panel(shape.position, shape.poles, note, worn=worn))
    if not panels:
        raise UnknownTable("the store has no table of shapes.", "Build one: `wizen table build`.")
    return sheet([panels[i : i + _COLUMNS] for i in range(0, len(panels), _COLUMNS)], pixels=_LARGE)


def shade(solver: Solver, info: TableInfo, families: Families) -> Shade | None:
    """Return the skin of a table's fruits: the one that begins its name, or that of a preset in it; None for none."""
    found = solver.looks.shade_of((info.name, *families.presets_of(info)))
    return None if found is None else found[1]
