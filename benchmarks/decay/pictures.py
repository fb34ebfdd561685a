"""Pictures of the decay examples, each solved anew: python -m benchmarks.decay.pictures PLAN.toml FILE.png.

One row per sample, one column per stage. --group draws all samples of a stage as one heap: the first stands at the
origin, the others where it sees its neighbours. Touching round fruits never hide one another in turn, so that painting
them from the farthest to the nearest is right.
"""

from __future__ import annotations

import argparse
import io
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from solver.contract import Need
from solver.decay import SOLVER, DecayParams
from sweeps.pictures.render import View, render
from sweeps.pictures.sheet import Panel, sheet

PIXELS = 260


def solved(plan: dict[str, Any]) -> list[tuple[DecayParams, xr.Dataset]]:
    """Return parameters and result of each sample."""
    need = plan["need"] | {"fields": tuple(plan["need"]["fields"]), "stages": tuple(plan["need"]["stages"])}
    runs = []
    for sample in plan["samples"]:
        params = SOLVER.parse({**plan.get("set", {}), **sample}, plan["preset"])
        assert isinstance(params, DecayParams)
        runs.append((params, SOLVER.solve(params, Need(**need))))
    return runs


def painted(params: DecayParams, stage: xr.Dataset) -> NDArray[Any]:
    """Return the colours (n, 2 n, 3) of a stage."""
    fields = {name: stage[name].values for name in ("rot", "mould", "mould_active")}
    assert SOLVER.looks.paint is not None
    skin = SOLVER.looks.paint(fields, params.model_dump())
    assert skin is not None
    return skin.colour


def rows(runs: list[tuple[DecayParams, xr.Dataset]], view: View, named: list[str]) -> bytes:
    """Return a sheet with a row per run."""
    panels = [
        [Panel(run.position.values[k], colour=painted(params, run.isel(stage=k))) for k in range(run.sizes["stage"])]
        for params, run in runs
    ]
    days = [f"day {day:g}" for day in runs[0][1].stage.values]
    return sheet(panels, column_labels=days, row_labels=named if len(runs) > 1 else (), pixels=PIXELS, view=view)


def heap(runs: list[tuple[DecayParams, xr.Dataset]], view: View) -> bytes:
    """Return a strip with all runs as one heap per stage."""
    first = runs[0][0]
    centres = np.array([(0.0, 0.0, 0.0), *(n.position for n in first.neighbours)])
    centres -= centres.mean(axis=0)
    turn, tilt = np.radians([view.azimuth, view.elevation])
    eye = np.array([np.cos(tilt) * np.cos(turn), np.sin(tilt), np.cos(tilt) * np.sin(turn)])
    view = View(view.azimuth, view.elevation, 1.15 * float(np.linalg.norm(centres, axis=1).max() + 1.1))
    strips = []
    for k in range(runs[0][1].sizes["stage"]):
        picture: NDArray[Any] | None = None
        for i in np.argsort(centres @ eye):
            params, run = runs[i]
            place = run.position.values[k] + centres[i]
            shown = render(place, pixels=2 * PIXELS, view=view, colour=painted(params, run.isel(stage=k)))
            if picture is None:
                picture = shown
                continue
            # what a fruit covers is where its colour shows, less the rim that is blended with the paper
            bright, dark = (
                render(place, pixels=2 * PIXELS, view=view, colour=np.full_like(place, tone)) for tone in (1.0, 0.0)
            )
            covered = ndimage.binary_erosion((bright.astype(int) - dark).max(axis=-1) > 0)[..., None]
            picture = np.where(covered, shown, picture)
        assert picture is not None
        strips.append(picture)
    out = io.BytesIO()
    Image.fromarray(np.concatenate(strips, axis=1)).save(out, "PNG")
    return out.getvalue()


def main() -> None:
    """Draw one example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plan", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--group", action="store_true", help="all samples as one heap")
    parser.add_argument("--azimuth", type=float, default=35.0)
    parser.add_argument("--elevation", type=float, default=22.0)
    asked = parser.parse_args()
    plan = tomllib.loads(asked.plan.read_text())
    runs, view = solved(plan), View(asked.azimuth, asked.elevation)
    named = [f"{p.temperature:g} C, {p.humidity:g} %, growth {p.growth_rate:g}" for p, _ in runs]
    asked.out.write_bytes(heap(runs, view) if asked.group else rows(runs, view, named))


if __name__ == "__main__":
    main()
