"""The paper's maps as measured statements: python -m benchmarks.dehydration.claims [--store DIR] [--judge].

Runs what is cheap of the plans examples/fig7.toml and examples/maps, and judges the statements C1 to C6 of Liu et al.
2014, section 4, at s = 0.3: a part of each fruit between planes of symmetry, at preview, of skins not thinner than
`--thinnest` (of Table 1 than `--thinnest-fruit`), with three seeds, each from its own noise. The maps as they are
shipped are judged by `benchmarks.dehydration.mapped`. What is stored already is not run again; `--judge` runs nothing.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks import figures
from benchmarks.figures import ROOT, Sheet
from solver.contract import Need
from solver.dehydration import SOLVER, DehydrationParams
from store.ledger.jobs import JobSpec
from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.runner import run_jobs

from .criteria import Found, judge
from .pattern import Pattern, pattern
from .shown import shown

STAGE = 0.3
#: The figures and tables that are judged, and the plans in examples/ of what they show.
SHOWN = ("fig7", "fig8", "fig9", "fig10", "table1")
PLANS = ("fig7.toml", "maps/*.toml")
#: The start of wrinkling as well, where patterns are most regular.
_NEED = Need(stages=(0.1, STAGE), quality="preview", resolution=96)


def jobs(name: str, seeds: list[int], thinnest: float) -> list[JobSpec]:
    """Return the cheap runs of what a figure or a table shows, each with several seeds."""
    paths = [path for plan in PLANS for path in sorted((ROOT / "examples").glob(plan))]
    samples = [params for path in paths for params in Plan.load(path).samples if isinstance(params, DehydrationParams)]
    parts = [
        {**params.model_dump(mode="json"), "mirrors": planes(params), "seed": seed, "pattern": None}
        for seed in seeds
        for params in samples
        if params.exocarp_thickness >= thinnest and name in shown(params)
    ]
    found = [JobSpec.of(SOLVER, SOLVER.parse(values), SOLVER.settle(_NEED)) for values in parts]
    return list({job.key: job for job in found}.values())


def planes(params: DehydrationParams) -> str:
    """Return the planes that a fruit is symmetric about: the equator's too where its halves are alike."""
    outline = params.radii[:7]
    return "xyz" if outline == outline[::-1] else "xz"


def found(store: Store, job: JobSpec) -> Pattern | None:
    """Return the pattern of a job's result at the stage, None if it is not stored, or ended before."""
    run = store.get(job.key) if store.has(job.key) else None
    return None if run is None or STAGE not in run.stage else pattern(run.sel(stage=STAGE))


def keep(runs: list[dict[str, Any]], clauses: list[Found]) -> None:
    """Print the clauses, and write the record."""
    sheet = Sheet("dehydration-claims", ("", "what the paper says", "of", f"at s = {STAGE}", "verdict"), "dehydration")
    for one in clauses:
        sheet.add(one)
    told = {"head": sheet.head, "rows": sheet.rows}
    figures.keep("dehydration-claims", runs, "dehydration", stage=STAGE, clauses=told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, default=Path("out/claims"), help="where runs are kept, and found again")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--thinnest", type=float, default=0.03, help="thinnest skin of Figs. 7 to 10 [r1]")
    parser.add_argument("--thinnest-fruit", type=float, default=0.03, help="thinnest skin of Table 1 [r1]")
    parser.add_argument("--judge", action="store_true", help="run nothing")
    asked = parser.parse_args()
    store = Store.open(asked.store, create=True)
    wanted = {
        name: jobs(name, asked.seeds, asked.thinnest_fruit if name == "table1" else asked.thinnest) for name in SHOWN
    }
    if not asked.judge:
        with executors.serial() as executor:
            for name, own in wanted.items():
                print(f"{name}: {run_jobs(own, store, executor, name)}", flush=True)
    runs, patterns = [], {name: list[Pattern]() for name in SHOWN}
    for name, own in wanted.items():
        for job in own:
            one = found(store, job)
            runs.append({"plan": name, "key": job.key, **(one._asdict() if one else {"missing": True})})
            patterns[name] += [one] if one else []
    keep(runs, judge(patterns))


if __name__ == "__main__":
    main()
