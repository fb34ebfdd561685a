"""Controls of the package's families: python -m benchmarks.dehydration.claims.controls [--seconds 300].

Of each family that was started from a pattern, the sample that is expected to take least is solved again twice: from
the pattern, by the solver as it is, where another version made the table; and without it, from its bumps alone, or
taken from a store that has that run. What that changes in what is counted and measured, stage by stage, and how alike
the wrinkles are. Kept after each run; what the record has of the solver's version is not run again, and what is
expected to take longer is left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import xarray as xr

from benchmarks import figures
from benchmarks.figures import Row, markdown
from solver import registry
from solver.contract import Context, Need
from solver.dehydration import SOLVER
from store import starter
from store.generations import trust
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import measures
from store.surfaces.measures import Surface

__all__ = ["table"]

NAME = "dehydration-controls"
_COMPARED = ("roughness", "dominant_degree", "buckle_count", "volume")


def main() -> None:
    """Run what is missing, the cheapest first."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=300.0, help="most that one run is expected to take [s]")
    parser.add_argument("--families", nargs="+", help="only these")
    parser.add_argument("--store", type=Path, help="take cold runs from there where it has them")
    asked = parser.parse_args()
    limit, other = asked.seconds, None if asked.store is None else Store.open(asked.store)
    kept = figures.load(NAME)["runs"] if NAME in figures.names() else []
    runs = [row for row in kept if row["version"] == SOLVER.version]
    store = Store.open(starter.ROOT)
    for seconds, name, i in sorted(_cheapest(store, name) for name in asked.families or store.table_names()):
        table_ = ShapeTable.open(store, name, surfaces=registry.surface)
        digest = table_.digest[:12]
        if not table_.at_parameters(table_.sample(i)).get("pattern") or seconds > limit:
            continue
        if any((row["family"], row["digest"]) == (name, digest) for row in runs):
            continue
        runs = [row for row in runs if row["family"] != name]
        about = {"version": SOLVER.version, "family": name, "digest": digest}
        runs.append({**about, **_controlled(store, table_, i, other)})
        figures.keep(NAME, runs, "dehydration", threads=1)
        print(name, file=sys.stderr, flush=True)


def _need(table_: ShapeTable) -> Need:
    fields = ("displacement", *_COMPARED)
    return SOLVER.settle(
        Need(stages=table_.stages, quality=table_.info.quality, fields=fields, resolution=_lattice(table_))
    )


def _lattice(table_: ShapeTable) -> int:
    return measures.lattice_for(table_.resolution)


def _cheapest(store: Store, name: str) -> tuple[float, str, int]:
    """Return what the cheapest sample of a family is expected to take [s], its name, and which sample it is."""
    table_ = ShapeTable.open(store, name, surfaces=registry.surface)
    need = _need(table_)
    costs = [SOLVER.cost(_cold(table_, i), need).seconds for i in range(table_.size)]
    least = min(range(table_.size), key=costs.__getitem__)
    return costs[least], name, least


def _cold(table_: ShapeTable, i: int) -> Any:
    return SOLVER.parse({**table_.at_parameters(table_.sample(i)), "pattern": None})


def _stored(other: Store | None, table_: ShapeTable, params: Any) -> xr.Dataset | None:
    """Return a run of these parameters, quality, stages and lattice that a store holds, of the solver as it is."""
    said = params.model_dump(mode="json")
    for job in [] if other is None else other.ledger.jobs("done"):
        if job.params == said and job.version == SOLVER.version and job.need["quality"] == table_.info.quality:
            assert other is not None
            run = other.get(job.key)
            if run["stage"].values.tolist() == list(table_.stages) and len(run["colatitude"]) == _lattice(table_):
                return run
    return None


def _controlled(store: Store, table_: ShapeTable, i: int, other: Store | None) -> Row:
    """Return the numbers of a sample as it is in its table, solved anew, and of the same fruit without a pattern."""
    sample = table_.sample(i)
    params = SOLVER.parse(table_.at_parameters(sample))
    fresh = trust.fresh(registry.surface(SOLVER.name).of(params.model_dump()), _lattice(table_))
    stored = [
        table_.at(sample, s, resolution=_lattice(table_), fields=("displacement",), apart=False) for s in table_.stages
    ]
    truth = [Surface(fresh, one.displacement) for one in stored]
    row: Row = {
        "sample": sample,
        "stages": list(table_.stages),
        "quality": table_.info.quality,
        "seed": 0,
        "table_version": table_.info.version,
        "stored": {name: [one.descriptors[name] for one in stored] for name in _COMPARED},
    }
    ways = {"anew": params, "cold": _cold(table_, i)}
    if table_.info.version == SOLVER.version:
        del ways["anew"]  # they would be the samples
    for name, asked in ways.items():
        begin = time.process_time()
        held = _stored(other, table_, asked)
        run = SOLVER.solve(asked, _need(table_), Context(library=store.find)) if held is None else held
        spent = time.process_time() - begin if held is None else None
        found = [Surface(fresh, u) for u in run["displacement"].transpose("stage", ...).values]
        row[name] = {each: run[each].values.tolist() for each in _COMPARED} | {
            "correlation": [measures.compare(a, b).corr for a, b in zip(found, truth, strict=True)],
            "steps": int(run["iterations"].values[-1]),
            "converged": run["converged"].values.tolist(),
            "cpu": spent,
        }
    return row


def table(record: Row) -> str:
    """Return by how much what was solved anew and cold is off the table, by family and stage."""
    lines = []
    for row in record["runs"]:
        said = ", ".join(f"{axis} {value:g}" for axis, value in row["sample"].items())
        for name, run in ((name, row[name]) for name in ("anew", "cold") if name in row):
            off = [
                " ".join(_off(c, p) for c, p in zip(run[each], row["stored"][each], strict=True)) for each in _COMPARED
            ]
            alike = " ".join(f"{value:.2f}" for value in run["correlation"])
            spent = "stored" if run["cpu"] is None else f"{run['cpu']:.0f}"
            lines.append([row["family"], said, row["quality"], name, alike, *off, spent])
    stages = ", ".join(f"{s:g}" for s in record["runs"][0]["stages"])
    return markdown(
        (
            *("family", "sample", "quality", "solved", f"correlation at s = {stages}", "roughness"),
            *("dominant degree", "buckles", "volume", "CPU s"),
        ),
        lines,
    )


def _off(cold: float, stored: float) -> str:
    return f"{100 * (cold / stored - 1):+.0f} %" if stored else ("=" if not cold else "new")


if __name__ == "__main__":
    main()
