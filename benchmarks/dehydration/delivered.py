"""The table that comes with wizen, as its runs settled and as its shapes are handed over.

    python -m benchmarks.dehydration.delivered --store maps/starter [--shapes 600]

Of each run behind it: residuals, crossing triangles of the finite elements and of the lattice, the least J (record
dehydration-starter). Of its samples and of random questions to it, at 64 colatitudes: how many shapes cross themselves,
and in how many pairs of those triangles that files hold (record dehydration-delivered).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from benchmarks.figures import Sheet
from solver import registry
from solver.dehydration.measures.penetration import of_lattice
from store.lookup import ShapeTable
from store.store import Store

_RESOLUTION = 64


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True, help="where its runs are")
    parser.add_argument("--shapes", type=int, default=600, help="random questions")
    asked = parser.parse_args()
    store = Store.open(asked.store)
    table = ShapeTable.open(store, surfaces=registry.surface)
    runs = sorted(map(store.get, table.info.keys), key=_place)
    _settled(runs, table)
    _delivered([_place(run) for run in runs], table, asked.shapes)


def _settled(runs: Sequence[xr.Dataset], table: ShapeTable) -> None:
    """Print and keep how the runs behind the table settled."""
    head = ("te", "gamma", "residual of each stage / 1e-3", "met", "crossing pairs", "evened [r1]", "least J")
    sheet = Sheet("dehydration-starter", head, table.info.solver)
    for run in runs:
        te, gamma = _place(run)
        columns = {name: run[name].values.tolist() for name in ("residual", "drift", "converged", "least_jacobian")}
        pairs = int(run["crossings"].sum() + run["lattice_crossings"].sum())
        moved, least = float(run["lattice_evened"].max()), min(columns["least_jacobian"])
        residuals = " ".join(f"{1e3 * value:.2f}" for value in columns["residual"])
        met = f"{sum(columns['converged'])} of {len(columns['converged'])}"
        sheet.add(
            (f"{te:g}", f"{gamma:g}", residuals, met, pairs, f"{moved:.3f}", f"{least:.2f}"),
            te=te, gamma=gamma, pairs=pairs, evened=moved, version=str(run.attrs["solver_version"]), **columns,
        )  # fmt: skip
    sheet.keep(digest=table.digest)


def _place(run: xr.Dataset) -> tuple[float, float]:
    """Return te and gamma of a run."""
    params = json.loads(run.attrs["params"])
    return params["exocarp_thickness"], params["modulus_ratio"]


def _delivered(places: Sequence[tuple[float, float]], table: ShapeTable, count: int) -> None:
    """Print and keep how many delivered shapes cross themselves."""
    sheet = Sheet(
        "dehydration-delivered", ("shapes", "s", "asked", "cross", "most pairs", "deepest [r1]"), "dehydration"
    )
    rng = np.random.default_rng(0)
    te, gamma = table.info.axes["te"], np.log(table.info.axes["gamma"])
    drawn = [(float(rng.uniform(*te)), float(np.exp(rng.uniform(*gamma)))) for _ in range(count)]
    for what, asked in (("samples", list(places)), ("between them", drawn)):
        share = len(table.stages) if asked is drawn else 1
        for i, stage in enumerate(table.stages):
            _add(sheet, table, what, stage, asked[i % share :: share])
    sheet.keep(digest=table.digest, resolution=_RESOLUTION)


def _add(sheet: Sheet, table: ShapeTable, what: str, stage: float, asked: Sequence[tuple[float, float]]) -> None:
    found = []
    for te, gamma in asked:
        position = table.at({"te": te, "gamma": gamma}, stage, resolution=_RESOLUTION, fields=("position",)).position
        found.append(of_lattice(np.asarray(position, float)))
    pairs = [one.count for one in found]
    crossing, deepest = sum(count > 0 for count in pairs), max(one.depth for one in found)
    sheet.add(
        (what, f"{stage:g}", len(found), crossing, max(pairs), f"{deepest:.3f}"),
        what=what, s=stage, asked=len(found), crossing=crossing, pairs=pairs, deepest=deepest,
    )  # fmt: skip


if __name__ == "__main__":
    main()
