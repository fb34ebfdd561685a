"""The gallery of Combaz and Neyret 2004, Fig. 2: every file in examples/growth grown, measured and drawn.

python -m benchmarks.growth.gallery [--quality Q] [--keep FOLDER] [--out docs/growth-gallery.png]
    [--times docs/growth-times.png] [NAME ...]

prints a table; CPU seconds of one thread, kernels compiled beforehand; crossings: edges that pass through triangles,
at growth time 1. --times draws each at three times of growth, at one scale.
With --keep, results are written to the folder, and those newer than their example file are not grown again.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import xarray as xr

from benchmarks.figures import Sheet
from benchmarks.growth.crossings import crossings
from solver import registry
from solver.contract import Need, SolverError
from sweeps.outputs import triangles
from sweeps.pictures.render import View
from sweeps.pictures.sheet import Panel, sheet

_FOLDER = Path(__file__).parents[2] / "examples" / "growth"
_FIELDS = ["mesh_position", "red", "green", "blue"]
_COLUMNS = 5
#: Growth times that are drawn; the last is measured. And files in a row of that sheet.
_TIMES, _ABREAST = (0.35, 0.7, 1.0), 2
#: What lies flat is looked at from above, a strip from its side.
_VIEWS = {"b-leaf": (60, 60), "c": (60, 60), "c-pumpkin": (35, 22), "c-flower": (60, 55), "d-bed": (55, 35)}
_VIEWS |= {"e-cloth": (35, 25), "f-cabbage": (35, 22), "h-fern": (35, 22), "h-lettuce": (50, 50)}


def grown(path: Path, quality: str, keep: Path | None) -> xr.Dataset:
    """Return the run of a file at growth time 1 with its CPU seconds, from the folder if it is there and newer."""
    kept = keep / f"{path.stem}-{quality}.nc" if keep else None
    if kept and kept.exists() and kept.stat().st_mtime > path.stat().st_mtime:
        with xr.open_dataset(kept, engine="h5netcdf") as found:
            return found.load()
    solver = registry.get("growth")
    params = solver.parse(tomllib.loads(path.read_text(encoding="utf-8")))
    begun = time.process_time()
    run = solver.solve(params, Need.parse({"stages": list(_TIMES), "quality": quality, "fields": _FIELDS}))
    run.attrs["cpu"] = time.process_time() - begun
    if kept:
        kept.parent.mkdir(parents=True, exist_ok=True)
        run.to_netcdf(kept, engine="h5netcdf")
    return run


def _view(name: str) -> View:
    return View(*_VIEWS.get(name, _VIEWS.get(name[0], (35, 22))))


def panel(run: xr.Dataset, name: str) -> Panel:
    """Return its picture: each in the middle and at its own size, for a bed is no mushroom."""
    shape = triangles(run)[-1]
    x = np.asarray(shape.position, float)
    x = x - (x.max(axis=0) + x.min(axis=0)) / 2
    return replace(shape, position=x / np.linalg.norm(x, axis=1).max(), note=name, view=_view(name))


def panels_in_time(run: xr.Dataset, name: str) -> list[Panel | None]:
    """Return its pictures at the growth times of the run, all at one scale; its name stands below the middle one."""
    shapes, times = triangles(run), run["stage"].values
    notes = [name if k == len(times) // 2 else f"t = {float(time):g}" for k, time in enumerate(times)]
    return [replace(shape, note=note, view=_view(name)) for shape, note in zip(shapes, notes, strict=True)]


def line(run: xr.Dataset, name: str) -> tuple[str, ...]:
    """Return its row of the table."""
    shape = triangles(run)[-1]
    through = crossings(np.asarray(shape.position, float), np.asarray(shape.triangles, np.int64))
    count, residual, steps = int(run["vertex_count"][-1]), float(run["residual"][-1]), int(run["iterations"][-1])
    return name, str(count), f"{residual:.1e}", str(steps), f"{run.attrs['cpu']:.1f}", str(through or "none")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quality", default="default")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--times", type=Path)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args()
    paths = [_FOLDER / f"{name}.toml" for name in asked.names] or sorted(_FOLDER.glob("*.toml"))
    solver = registry.get("growth")
    solver.solve(solver.parse({}), Need.parse({"stages": [0.1], "quality": "preview"}))  # compile
    table = Sheet("growth-gallery", ("file", "vertices", "residual", "iterations", "CPU s", "crossings"), "growth")
    panels, times = [], []
    for path in paths:
        try:
            run = grown(path, asked.quality, asked.keep)
        except SolverError as error:
            table.add((path.stem, "", "", "", "", error), file=path.stem, failed=str(error))
            continue
        table.add(line(run, path.stem))
        panels.append(panel(run, path.stem))
        times.append(panels_in_time(run, path.stem))
    if not asked.names:
        table.keep(quality=asked.quality)
    if asked.out:
        rows = [panels[i : i + _COLUMNS] for i in range(0, len(panels), _COLUMNS)]
        asked.out.write_bytes(sheet(rows, title="Growth: the gallery of Combaz and Neyret 2004, Fig. 2", pixels=240))
    if asked.times:
        abreast = [list(chain(*times[i : i + _ABREAST])) for i in range(0, len(times), _ABREAST)]
        asked.times.write_bytes(
            sheet(abreast, title="Growth: each at t = " + ", ".join(f"{time:g}" for time in _TIMES), pixels=135)
        )


if __name__ == "__main__":
    main()
