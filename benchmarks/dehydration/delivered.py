"""The table that comes with wizen, as its runs settled and handed over.

    python -m benchmarks.dehydration.delivered --store maps/starter

Of each run behind it: residuals, crossing triangles of the finite elements and of the lattice, the least J, and the
volume within its surface over that of incompressible flesh and skin (record dehydration-starter). What is answered
between its samples is counted by `benchmarks.dehydration.apart`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from benchmarks.figures import Sheet
from solver import registry
from store.lookup import ShapeTable
from store.store import Store

from .balance import sphere_volume


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True, help="where its runs are")
    asked = parser.parse_args()
    store = Store.open(asked.store)
    table = ShapeTable.open(store, surfaces=registry.surface)
    runs = sorted(map(store.get, table.info.keys), key=_place)
    _settled(runs, table)


def _settled(runs: Sequence[xr.Dataset], table: ShapeTable) -> None:
    """Print and keep how the runs behind the table settled."""
    stages = "residual of each stage / 1e-3", "met", "crossing pairs", "evened [r1]", "least J", "volume off [%]"
    head = ("te", "gamma", *stages)
    sheet = Sheet("dehydration-starter", head, table.info.solver)
    for run in runs:
        te, gamma = _place(run)
        columns = {name: run[name].values.tolist() for name in ("residual", "drift", "converged", "least_jacobian")}
        pairs = int(run["crossings"].sum() + run["lattice_crossings"].sum())
        moved, least = float(run["lattice_evened"].max()), min(columns["least_jacobian"])
        residuals = " ".join(f"{1e3 * value:.2f}" for value in columns["residual"])
        exact = [sphere_volume(float(table.fixed["rs1"]), te, s) for s in table.stages]
        off = (run["volume"].values / exact - 1).tolist()
        met = f"{sum(columns['converged'])} of {len(columns['converged'])}"
        sheet.add(
            (f"{te:g}", f"{gamma:g}", residuals, met, pairs, f"{moved:.3f}", f"{least:.2f}", _told(off)),
            te=te, gamma=gamma, pairs=pairs, evened=moved, off=off, version=str(run.attrs["solver_version"]), **columns,
        )  # fmt: skip
    sheet.keep(digest=table.digest)


def _told(off: Sequence[float]) -> str:
    """Return shares in percent, stage by stage."""
    return " ".join(f"{100 * value:+.2f}" for value in off)


def _place(run: xr.Dataset) -> tuple[float, float]:
    """Return te and gamma of a run."""
    params = json.loads(run.attrs["params"])
    return params["exocarp_thickness"], params["modulus_ratio"]


if __name__ == "__main__":
    main()
