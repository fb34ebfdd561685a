"""Scores of look-up methods: how shapes between a table's samples compare with the runs that they stand for."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from solver.arrays import Array
from solver.contract import Fresh
from solver.lattice import lattice
from store import keys
from store.blending import methods
from store.generations.samples import read_axes
from store.ledger.jobs import Job
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import measures, spectra
from store.surfaces.measures import Measures, Surface

from ..errors import InvalidOption
from ..pictures.sheet import Panel, sheet
from ..planning.plan import Plan

__all__ = ["Case", "Report", "Row", "cases", "picture", "score"]


#: Parameters of a run that change its pattern but not what it is like.
_SEED = "seed"
#: Cases that a picture shows at most.
_SHOWN = 5


@dataclass(frozen=True)
class Case:
    """A shape that is known and one that is looked up: both displacements (n, 2n, 3), on the `lattice` of n that holds
    the table's waves.
    """

    label: str
    lattice: int
    start: Fresh
    truth: Callable[[float], Array]
    found: Callable[[str, float], Array]

    @property
    def fresh(self) -> Array:
        """Fresh positions (n, 2n, 3)."""
        return self.start.points(*lattice(self.lattice))


class Row(NamedTuple):
    """Means over all cases of one method at one stage; the method `seed` is the floor."""

    method: str
    stage: float
    measures: Measures


class Report(NamedTuple):
    """All rows, how many cases and pairs of seeds went in, whether runs were held out, and the correlations."""

    rows: list[Row]
    held_out: bool
    labels: list[str]
    seeds: int
    correlation: dict[float, float]

    def to_json(self) -> dict[str, Any]:
        """Return the report as JSON values."""
        return {
            "held_out": self.held_out,
            "cases": self.labels,
            "seed_pairs": self.seeds,
            "units": measures.UNITS,
            "rows": [{"method": r.method, "stage": r.stage, **r.measures._asdict()} for r in self.rows],
            "neighbour_correlation": [{"stage": s, "correlation": c} for s, c in self.correlation.items()],
        }


def cases(store: Store, table: ShapeTable, held: Path | None) -> tuple[list[Case], list[tuple[Case, Case]]]:
    """Return what to score, and pairs of runs that differ in their seed alone.

    `held` is a store, or a plan whose runs are in `store`; without it every sample is predicted from the others.

    Raises:
        InvalidOption: nothing in it can be looked up in this table.

    """
    if held is None:
        if not table.axes:
            raise InvalidOption("a table of one sample predicts nothing.", "Name runs to compare with: --held-out.")
        return [_left_out(table, i) for i in range(table.size)], []
    runs = list(_runs(store, table, held))
    scored = [_held_out(table, result, job) for result, job in runs if job.params.get(_SEED) == _seed(table)]
    if not scored:
        raise InvalidOption(
            f"{held} has no finished run between the samples of this table.",
            "The runs must be of the same solver, share its fixed parameters and stages, and lie inside its axes.",
        )
    pairs = [
        (_held_out(table, *a), _held_out(table, *b))
        for a, b in itertools.combinations(runs, 2)
        if {**a[1].params, _SEED: 0} == {**b[1].params, _SEED: 0}
    ]
    return scored, pairs


def score(
    table: ShapeTable,
    found: Sequence[Case],
    pairs: Sequence[tuple[Case, Case]],
    names: Sequence[str] = methods.NAMED,
    held_out: bool = True,
) -> Report:
    """Score methods on cases at every stage of the table."""
    truths = {(i, s): Surface(case.fresh, case.truth(s)) for i, case in enumerate(found) for s in table.stages}

    def row(method: str, stage: float) -> Row:
        each = (
            measures.compare(Surface(case.fresh, case.found(method, stage)), truths[i, stage])
            for i, case in enumerate(found)
        )
        return Row(method, stage, measures.mean(each))

    rows = [row(method, stage) for method in names for stage in table.stages]
    for stage in table.stages if pairs else ():
        sides = [(Surface(a.fresh, a.truth(stage)), Surface(b.fresh, b.truth(stage))) for a, b in pairs]
        # rgh of one seed over another is a ratio: both ways round, or its mean would depend on their order
        each = [measures.compare(a, b) for a, b in [*sides, *((b, a) for a, b in sides)]]
        rows.append(Row("seed", stage, measures.mean(each)))
    return Report(rows, held_out, [case.label for case in found], len(pairs), table.neighbour_correlation)


def picture(found: Sequence[Case], stage: float) -> bytes:
    """Return a PNG of truth, the paper's inverse distance and the default, side by side for each case."""

    def panel(case: Case, displacement: Array) -> Panel:
        return Panel(case.fresh + displacement)

    shown = found[:_SHOWN]
    rows = [
        [
            panel(case, case.truth(stage)),
            panel(case, case.found("idw", stage)),
            panel(case, case.found(methods.DEFAULT, stage)),
        ]
        for case in shown
    ]
    labels = ("truth", "the paper's (idw)", f"default ({methods.DEFAULT})")
    return sheet(
        rows,
        title=f"between samples, s = {stage:g}",
        column_labels=labels,
        row_labels=[case.label.replace(", ", "\n") for case in shown],
        pixels=260,
    )


def _left_out(table: ShapeTable, i: int) -> Case:
    values, n = table.sample(i), measures.lattice_for(table.resolution)

    def truth(stage: float) -> Array:
        shape = table.at(values, stage, resolution=n, fields=("displacement",), apart=False)
        assert shape.displacement is not None
        return shape.displacement

    return Case(_label(values), n, table.fresh(values), truth, lambda method, s: table.left_out(i, s, method, n))


def _held_out(table: ShapeTable, result: xr.Dataset, job: Job) -> Case:
    values = read_axes(job.params, {name: table.info.places[name] for name in table.axes})
    fields = result["displacement"].transpose("stage", "colatitude", "azimuth", "component")
    n = measures.lattice_for(table.resolution)

    def truth(stage: float) -> Array:
        at = int(np.abs(result["stage"].values - stage).argmin())
        field = fields.values[at].astype(float)
        # to the table's band, which is all that a look-up could know
        waves = spectra.truncate(spectra.spectrum(field), table.resolution)
        return spectra.synthesize(waves, n)

    def found(method: str, stage: float) -> Array:
        shape = table.at(values, stage, resolution=n, fields=("displacement",), method=method, apart=False)
        assert shape.displacement is not None
        return shape.displacement

    return Case(_label(values), n, table.fresh(values), truth, found)


def _runs(store: Store, table: ShapeTable, held: Path) -> Iterator[tuple[xr.Dataset, Job]]:
    if held.is_dir():
        source, only = Store.open(held), None
    else:
        source, only = store, {job.key for job in Plan.load(held).jobs()}
    for job in source.ledger.jobs("done"):
        wanted = only is None or job.key in only
        if wanted and job.key not in table.info.keys and _fits(table, job):
            yield source.get(job.key), job


def _fits(table: ShapeTable, job: Job) -> bool:
    if job.solver != table.info.solver:
        return False
    stages = job.need["stages"]
    if job.need.get("region") is not None or "displacement" not in job.need["fields"]:
        return False
    if any(min(abs(stage - s) for s in stages) > 1e-9 for stage in table.stages):
        return False
    values = read_axes(job.params, {name: table.info.places[name] for name in table.axes})
    if any(not low <= values[name] <= high for name, (low, high) in table.axes.items()):
        return False
    # all that is fixed, which is the template with the run's own place on the axes
    filled = {**table.at_parameters(values), _SEED: 0}
    return keys.canonical(filled) == keys.canonical({**job.params, _SEED: 0})


def _seed(table: ShapeTable) -> Any:
    return table.info.template.get(_SEED)


def _label(values: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())
