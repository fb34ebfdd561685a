"""C1 to C6 over the paper's whole maps, from the shapes in the package: python -m benchmarks.dehydration.mapped.

Nothing is run: every sample of every table in the package that Figs. 7 to 10 or Table 1 of Liu et al. 2014 show is read
as it is handed over, and judged at s = 0.3 by the criteria that `benchmarks.dehydration.claims` judges runs by. The
standard error is from the fruits that several families hold, each by its own pattern and another part of the fruit.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator

import xarray as xr

from benchmarks import figures
from benchmarks.figures import Sheet
from solver import registry
from solver.dehydration import SOLVER, DehydrationParams
from store import starter
from store.lookup import ShapeTable
from store.store import Store

from .claims.criteria import judge
from .claims.pattern import Pattern, pattern
from .claims.shown import shown

STAGE, RESOLUTION = 0.3, 128


def samples(package: Store) -> Iterator[tuple[str, DehydrationParams, ShapeTable, dict[str, float]]]:
    """Yield family, parameters, table and place of every sample in the package."""
    for name in package.table_names():
        table = ShapeTable.open(package, name, surfaces=registry.surface)
        for place in {tuple(table.sample(i).items()): table.sample(i) for i in range(table.size)}.values():
            yield name, SOLVER.parse(table.at_parameters(place)), table, place


def read(params: DehydrationParams, table: ShapeTable, place: dict[str, float]) -> Pattern:
    """Return the pattern of a sample as it is handed over, less the smooth fresh shape."""
    shape = table.at(place, STAGE, resolution=RESOLUTION, fields=("position", "displacement"))
    assert shape.displacement is not None
    told = xr.Dataset({"displacement": (("colatitude", "azimuth", "component"), shape.displacement)})
    # what it settled to is kept with the runs, not in the table
    told = told.assign(shape.descriptors).assign(converged=shape.converged, residual=math.nan)
    told.attrs = {
        "params": params.model_dump_json(),
        "need": json.dumps(dict(table.info.need)),
        "solver_version": table.info.version,
    }
    return pattern(told)


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    plans: dict[str, list[Pattern]] = {name: [] for name in ("fig7", "fig8", "fig9", "fig10", "table1")}
    runs = []
    for family, params, table, place in samples(Store.open(starter.ROOT)):
        figure_names = list(shown(params))
        if not figure_names:
            continue
        one = read(params, table, place)
        kept = {name: value for name, value in one._asdict().items() if name != "residual"}
        runs.append({"family": family, "figures": figure_names, **kept})
        print(f"{family}: te {one.te:g}, gamma {one.gamma:g}, {', '.join(figure_names)}", flush=True)
        for name in figure_names:
            plans[name].append(one)
    sheet = Sheet("dehydration-mapped", ("", "what the paper says", "of", f"at s = {STAGE}", "verdict"), "dehydration")
    for clause in judge(plans):
        sheet.add(clause)
    told = {"head": sheet.head, "rows": sheet.rows}
    figures.keep("dehydration-mapped", runs, "dehydration", stage=STAGE, table=told)


if __name__ == "__main__":
    main()
