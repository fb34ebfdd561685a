"""Draw the pictures that come with wizen: python -m benchmarks.portraits [--only WORD] [--seconds 90].

Of the package's tables, and of presets but for those of which there is a table: their pictures are of the table. What
is expected to take longer than `--seconds` is left out; what is drawn already by the solver's version is not drawn
again.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np

from service.portraits import DRAWN, said, table_file
from solver import registry
from solver.contract import Context, InvalidInput, Need, Solver, SolverError, dryness
from store import seal, starter
from store.errors import UnknownTable
from store.families import stored
from store.lookup import ShapeTable
from store.store import Store
from sweeps import families as covering
from sweeps import outputs, tabled
from sweeps.formats import Made
from sweeps.pictures.render import View
from sweeps.pictures.sheet import Panel

#: Side of a picture [pixels].
_PIXELS = 192
_QUALITY = "preview"
#: Where along its stages a preset is shown at its best, as a share of the last: rotten fruits are foil in the end, and
#: splinters have flown away.
_SHOWN = {"decay": 0.6, "dehydration": 0.67, "wood": 0.5}
#: Parts of dried fruits that are solved: a quarter, between planes that hold the long axis.
_MORE: dict[str, dict[str, Any]] = {"dehydration": {"mirrors": "xz"}}


def main() -> None:
    """Draw what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help='presets whose "solver/name" contains this')
    parser.add_argument("--seconds", type=float, default=90.0, help="most that one is expected to take [s]")
    asked = parser.parse_args()
    store = Store.open(starter.ROOT)
    _draw_tables(store)
    index = {name: dict(said(name)) for name in registry.names()}
    for name in registry.names():
        solver = registry.get(name)
        tabled_ones = _tabled(store, solver)
        for preset in solver.presets:
            if asked.only not in f"{name}/{preset}" or preset in tabled_ones:
                continue
            if index[name].get(preset, {}).get("version") == solver.version:
                continue
            try:
                picture, what = portrait(solver, preset, asked.seconds)
            except SolverError as error:
                print(f"{name}/{preset}: {error}", file=sys.stderr)
                continue
            (DRAWN / name).mkdir(parents=True, exist_ok=True)
            seal.publish(DRAWN / name / f"{preset}.png", picture)
            index[name][preset] = what
            text = json.dumps({key: value for key, value in index.items() if value}, indent=1, sort_keys=True) + "\n"
            seal.publish(DRAWN / "index.json", text.encode())
            print(f"{name}/{preset}: {len(picture) / 1e3:.0f} kB", file=sys.stderr, flush=True)


def _draw_tables(store: Store) -> None:
    """Draw each table of a store as the service would, and drop pictures of others."""
    wanted = set()
    for name in store.table_names():
        table = ShapeTable.open(store, name, surfaces=registry.surface)
        wanted.add(path := table_file(table.digest))
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            seal.publish(path, covering.drawn(table, stored.families(store, registry.get(table.info.solver)), store))
            print(f"table {name}", file=sys.stderr, flush=True)
    for path in set((DRAWN / "tables").glob("*.png")) - wanted:
        path.unlink()


def _tabled(store: Store, solver: Solver) -> set[str]:
    """Return the presets that a table of the package holds."""
    try:
        families = stored.families(store, solver)
    except UnknownTable:
        return set()
    return {preset for info in families.infos for preset in families.presets_of(info)}


def portrait(solver: Solver, preset: str, seconds: float) -> tuple[bytes, dict[str, Any]]:
    """Solve a preset at preview and return its picture, PNG, and what it is of.

    Raises:
        SolverError: it cannot be solved, or is expected to take longer than that.

    """
    from PIL import Image

    params = solver.parse(_MORE.get(solver.name, {}), preset)
    usual = solver.settle(Need(quality=_QUALITY), preset, (params,))
    stages = usual.stages
    stage = min(stages, key=lambda one: abs(one - _SHOWN.get(solver.name, 1.0) * stages[-1]))
    # with what gives the surface its colours
    fields = (*usual.fields, *outputs.fields_for(DRAWN / "preset.png", True, solver))
    need = solver.settle(Need(quality=_QUALITY, stages=(stage,), fields=fields), preset, (params,))
    expected = solver.cost(params, need).seconds
    if expected > seconds:
        raise InvalidInput(f"is expected to take {expected:.0f} s.", advice=f"Allow it: --seconds {expected:.0f}.")
    run = solver.solve(params, need, Context(shapes=tabled.shape))
    axes = {name: params.axis(name) for name in params.axes}
    shapes = [outputs.of_result(run, axes, 0)] if "position" in run else []
    panel, view = _framed(outputs.panels(Made(shapes, {}, preset, solver.name, run=run))[-1])
    plain = solver.looks.shade_of((preset, "clay"))
    if panel.colour is None and panel.triangles is None and plain is not None:
        panel = replace(panel, worn=plain[1].worn(dryness(stage, solver.stages.reach)))
    out = io.BytesIO()
    image = Image.fromarray(panel.image(_PIXELS, view))
    image.quantize(128, Image.Quantize.MEDIANCUT).save(out, "PNG", optimize=True)
    return out.getvalue(), {"version": solver.version, "quality": _QUALITY, "stage": stage}


def _framed(panel: Panel) -> tuple[Panel, View]:
    """Return a panel about the middle of what is drawn of it, and the view that it fills."""
    points = panel.position if panel.triangles is None else panel.position[np.unique(panel.triangles)]
    points = points.reshape(-1, 3)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    reach = float(np.linalg.norm(points - middle, axis=1).max())
    moved = replace(
        panel,
        position=panel.position - middle,
        poles=None if panel.poles is None else panel.poles - middle,
        more=None if panel.more is None else panel.more._replace(vertices=panel.more.vertices - middle),
    )
    seen = panel.view or View()
    return moved, View(seen.azimuth, seen.elevation, 1.05 * reach)


if __name__ == "__main__":
    main()
