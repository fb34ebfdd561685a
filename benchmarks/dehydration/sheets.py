"""Contact sheets of stored runs as they are, nothing interpolated.

python -m benchmarks.dehydration.sheets STORE FILE.png [--plans raisin,plum1 --first]

Of all runs in the store, of those of some plans, or of the first sample of each plan. One row per skin thickness, one
column per sample in the order of the other axes; --stages draws one row per sample instead, as in Fig. 11 of Liu et
al. 2014.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from benchmarks.dehydration.claims.pattern import name_of
from solver.dehydration.params import DehydrationParams
from solver.fruit import lattice
from store.store import Store
from sweeps.pictures.render import render

PIXELS = 260


def _order(params: DehydrationParams) -> tuple[float, ...]:
    return (params.modulus_ratio, *params.radii, *params.stone)


def _label(params: DehydrationParams) -> str:
    name = name_of(params)
    shape = "" if set(params.radii) == {1.0} else f", r4 {params.radii[3]:g}"
    known = f"{name}, " if name and name != "sphere" else ""
    return f"{known}te {params.exocarp_thickness:g}, gamma {params.modulus_ratio:g}, stone {params.stone[0]:g}{shape}"


def _image(params: DehydrationParams, data: xr.Dataset, stage: float) -> np.ndarray:
    shift = data["displacement"].sel(stage=stage).values
    return np.asarray(render(params.surface(*lattice(len(shift))) + shift, pixels=PIXELS))


def _keys(store: Store, plans: Sequence[str] | None, first: bool) -> list[str]:
    if plans is None:
        return list(store.keys())
    found = [[job.key for job in store.ledger.jobs("done", plan)] for plan in plans]
    return list(dict.fromkeys(key for keys in found for key in keys[: 1 if first else None]))


def main() -> None:
    """Draw one sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("store", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--stage", type=float, default=0.3, help="shrinkage s of all shapes")
    parser.add_argument(
        "--stages", type=lambda text: [float(part) for part in text.split(",")], help="one row a sample"
    )
    parser.add_argument("--plans", type=lambda text: text.split(","), help="runs of these plans only")
    parser.add_argument("--first", action="store_true", help="of each plan the run that was asked for first")
    asked = parser.parse_args()
    store = Store.open(asked.store)
    samples = []
    for key in _keys(store, asked.plans, asked.first):
        data = store.get(key)
        samples.append((DehydrationParams.model_validate(json.loads(data.attrs["params"])), data))
    samples.sort(key=lambda sample: (-sample[0].exocarp_thickness, _order(sample[0])))
    rows: list[list[tuple[DehydrationParams, xr.Dataset, float]]]
    if asked.stages:
        rows = [[(params, data, stage) for stage in asked.stages] for params, data in samples]
    else:
        skins = sorted({params.exocarp_thickness for params, _ in samples}, reverse=True)
        rows = [[(p, d, asked.stage) for p, d in samples if p.exocarp_thickness == te] for te in skins]
    columns = max(len(row) for row in rows)
    figure, axes = plt.subplots(len(rows), columns, figsize=(2.6 * columns, 2.75 * len(rows)), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for line, row in zip(axes, rows, strict=True):
        for axis, (params, data, stage) in zip(line, row, strict=False):
            axis.imshow(_image(params, data, stage))
            axis.set_title(f"{_label(params)}\ns = {stage:g}", fontsize=7)
    figure.tight_layout(pad=0.4)
    figure.savefig(asked.out, dpi=100, bbox_inches="tight")


if __name__ == "__main__":
    main()
