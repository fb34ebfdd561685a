"""What refinement wins on dried fruits over more points of Sobol's sequence: python -m benchmarks.dehydration.refining.

Runs `examples/refine.toml` and `refine-held-out.toml`, refines the first table, and beside it builds tables of as many
points of the sequence; all are scored by the held-out fruits (record dehydration-refine). With --store a stopped
benchmark goes on.
"""

from __future__ import annotations

import argparse
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from benchmarks.figures import ROOT, keep
from solver.dehydration import SOLVER
from store import tables
from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.refining.rounds import held_out_error, rounds
from sweeps.running import executors
from sweeps.running.runner import run_plan

_MEASURE = "dB"


def _plan(name: str, count: int | None = None) -> Plan:
    written: dict[str, Any] = tomllib.loads((ROOT / "examples" / f"{name}.toml").read_text(encoding="utf-8"))
    if count is not None:
        written["sampling"]["count"] = count
    return Plan.parse(written, name)


def _run(plan: Plan, root: Path, executor: Any) -> Store:
    store = Store.open(root, create=True)
    run_plan(plan, store, executor)
    return store


def _sequence(root: Path, held: Path, counts: list[int], executor: Any) -> list[dict[str, Any]]:
    """Return the held-out error of tables of so many points of the sequence, smallest first."""
    rows = []
    for count in counts:
        plan = _plan("refine", count)
        store = _run(plan, root, executor)
        tables.build(store, SOLVER, f"sobol-{count}", keys=[job.key for job in plan.jobs()])
        error, runs = held_out_error(store, f"sobol-{count}", held, _MEASURE)
        rows.append({"way": "Sobol alone", "runs": count, "held_out": error, "held_runs": runs})
        print(rows[-1], flush=True)
    return rows


def _refined(root: Path, held: Path, begun: int, more: int, executor: Any) -> list[dict[str, Any]]:
    plan = _plan("refine", begun)
    store = _run(plan, root, executor)
    tables.build(store, SOLVER, "refined", keys=[job.key for job in plan.jobs()])
    rows = []
    for found in rounds(plan, store, "refined", executor, more, _MEASURE, held):
        row = {"way": "refined", "runs": begun + found.added, "held_out": found.held_out, "held_runs": found.held_runs}
        rows.append(row | {"at": list(found.points), "failed": found.failed, "left_out": found.left_out})
        print(rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, help="keep the runs there, and go on with those that it holds")
    parser.add_argument("--begun", type=int, default=8, help="points of the sequence to begin with")
    parser.add_argument("--more", type=int, default=8, help="runs that refinement adds")
    parser.add_argument("--held", type=int, default=6, help="fruits held out")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, executors.serial() as executor:
        root = asked.store or Path(folder)
        held = _run(_plan("refine-held-out", asked.held), root / "held", executor).root
        rows = _refined(root / "refined", held, asked.begun, asked.more, executor)
        counts = sorted({asked.begun, asked.begun + (asked.more + 1) // 2, asked.begun + asked.more})
        rows += _sequence(root / "refined", held, counts, executor)
    lines = sorted({row["runs"] for row in rows})
    found = {(row["way"], row["runs"]): f"{row['held_out']:.2f}" for row in rows}
    cells = [
        [f"{way}, held out [{_MEASURE}]", *(found.get((way, runs), "") for runs in lines)]
        for way in ("refined", "Sobol alone")
    ]
    keep("dehydration-refine", rows, SOLVER.name, table={"head": ["runs", *map(str, lines)], "rows": cells})


if __name__ == "__main__":
    main()
