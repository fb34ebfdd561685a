"""Whether the error that a look-up says to expect covers what it errs by between two stored stages.

    python -m benchmarks.dehydration.claims.between [--store DIR]

A small family, 3 x 3 eighths of spheres at preview with stages every 0.05, asked half-way between its stages: at its
own parameters, where nothing else is to err, and between them. Runs of the very fruits to those stages are the truth
(record dehydration-between). `--store` keeps the runs; a second call takes them from there.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.figures import Sheet
from solver import registry
from solver.dehydration import SOLVER
from store import tables
from store.generations import trust
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces.measures import Measures, Surface, compare
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.runner import run_plan

_STAGES = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3]
_HALVES = [0.075, 0.125, 0.175, 0.225, 0.275]
_TE, _GAMMA = [0.04, 0.045, 0.05], [10, 14, 20]
#: Fruits off the samples, half a spacing away from the nearest.
_OFF = {"te": [0.0425, 0.0475], "gamma": [12]}
_SHOWN = ("rgh", "dB", "W1", "corr", "L2nr")
_HEAD = ("fruits", "s", "cases", *(f"{name} made, said" for name in _SHOWN), "covered")


def _plan(name: str, axes: dict[str, list[float]], stages: list[float]) -> Plan:
    need = {"stages": stages, "quality": "preview", "resolution": 64}
    asked = {"solver": SOLVER.name, "name": name, "preset": "sphere", "set": {"mirrors": "xyz"}}
    return Plan.parse({**asked, "axes": axes, "need": need}, name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, help="where the runs are kept")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(asked.store or Path(folder) / "store", create=True)
        family = _plan("family", {"te": _TE, "gamma": _GAMMA}, _STAGES)
        on, off = _plan("on", {"te": _TE, "gamma": _GAMMA}, _HALVES), _plan("off", _OFF, _HALVES)
        with executors.serial() as workers:
            for plan in (family, on, off):
                run_plan(plan, store, workers)
        tables.build(store, SOLVER, "family", keys=[job.key for job in family.jobs()])
        table = ShapeTable.open(store, "family", surfaces=registry.surface)
        sheet = Sheet("dehydration-between", _HEAD, "dehydration")
        for name, plan in (("its own", on), ("between them", off)):
            _add(sheet, name, store, table, plan)
        sheet.keep(family={"te": _TE, "gamma": _GAMMA, "stages": _STAGES}, measures=Measures._fields)


def _add(sheet: Sheet, name: str, store: Store, table: ShapeTable, plan: Plan) -> None:
    """Print and keep the errors made and said at each stage: medians, and the share of all that is covered."""
    found = {
        stage: np.array([_case(store, table, plan, i, stage) for i in range(len(plan.samples))]) for stage in _HALVES
    }
    for stage, pairs in found.items():
        made, said = np.moveaxis(pairs, 1, 0)
        places = [Measures._fields.index(shown) for shown in _SHOWN]
        sheet.add(
            (
                *(name, f"{stage:g}", len(pairs)),
                *(f"{np.median(made[:, k]):.2g}, {np.median(said[:, k]):.2g}" for k in places),
                f"{(made <= said).mean():.0%}",
            ),
            fruits=name, s=stage, made=made.tolist(), said=said.tolist(),
        )  # fmt: skip
    whole = np.concatenate(list(itertools.chain(found.values())))
    print(f"{name}: {(whole[:, 0] <= whole[:, 1]).mean():.0%} of {len(whole)} x {whole.shape[-1]} covered")


def _case(store: Store, table: ShapeTable, plan: Plan, i: int, stage: float) -> tuple[list[float], list[float]]:
    """Return the errors made and said, by measure, of one fruit at a stage half-way."""
    run, job = plan.samples[i], plan.jobs()[i]
    values = {axis: float(run.axis(axis)) for axis in table.axes}
    shape = table.at(values, stage, fields=("displacement",), apart=False)
    assert shape.displacement is not None
    assert shape.expected_error is not None
    truth = store.get(job.key)["displacement"].sel(stage=stage).values
    start = trust.fresh(table.fresh(values), len(truth))
    made = trust.errors(compare(Surface(start, shape.displacement), Surface(start, truth)))
    return list(made.values()), [shape.expected_error[measure] for measure in Measures._fields]


if __name__ == "__main__":
    main()
