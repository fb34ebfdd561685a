"""The paper's maps as measured statements: python -m benchmarks.dehydration.claims [--store DIR] [--whole] [--judge].

Runs what is cheap of the plans examples/fig7.toml and examples/maps, and judges the statements C1 to C6 of Liu et al.
2014, section 4, at s = 0.3: a part of each fruit between planes of symmetry, at preview, of skins not thinner than
`--thinnest` (of Table 1 than `--thinnest-fruit`), with three seeds, each from its own noise. With `--whole` the plans
are run as they are written, which takes days. What is stored already is not run again; `--judge` runs nothing.
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

STAGE = 0.3
#: The plans in examples/ behind each figure and table of the paper. A map of a fruit of Table 1 begins with that fruit.
PLANS = {
    "fig7": ("fig7",),
    "fig8": ("maps/stone-radius",),
    "fig9": ("maps/stone-length",),
    "fig10": ("maps/prolate",),
    "table1": tuple(f"maps/{fruit}" for fruit in ("plum2", "jujube1", "jujube2", "plum1", "raisin", "wolfberry")),
}
#: The start of wrinkling as well, where patterns are most regular.
_NEED = Need(stages=(0.1, STAGE), quality="preview", resolution=96)


def plans(name: str) -> list[Plan]:
    """Return the plans behind a figure or a table."""
    return [Plan.load(ROOT / "examples" / f"{plan}.toml") for plan in PLANS[name]]


def jobs(name: str, seeds: list[int], thinnest: float, whole: bool) -> list[JobSpec]:
    """Return the jobs that a figure or a table is judged by: the plans' own, or their cheap part with several seeds."""
    own = slice(1) if name == "table1" else slice(None)
    if whole:
        return [job for plan in plans(name) for job in plan.jobs()[own]]
    samples = [params for plan in plans(name) for params in plan.samples[own] if isinstance(params, DehydrationParams)]
    parts = [
        {**params.model_dump(mode="json"), "mirrors": planes(params), "seed": seed, "pattern": None}
        for seed in seeds
        for params in samples
        if params.exocarp_thickness >= thinnest
    ]
    return [JobSpec.of(SOLVER, SOLVER.parse(values), SOLVER.settle(_NEED)) for values in parts]


def planes(params: DehydrationParams) -> str:
    """Return the planes that a fruit is symmetric about: the equator's too where its halves are alike."""
    outline = params.radii[:7]
    return "xyz" if outline == outline[::-1] else "xz"


def found(store: Store, job: JobSpec) -> Pattern | None:
    """Return the pattern of a job's result at the stage, None if it is not stored, or ended before."""
    run = store.get(job.key) if store.has(job.key) else None
    return None if run is None or STAGE not in run.stage else pattern(run.sel(stage=STAGE))


def keep(runs: list[dict[str, Any]], clauses: list[Found], whole: bool) -> None:
    """Print the clauses, and write the record."""
    sheet = Sheet("dehydration-claims", ("", "what the paper says", "of", f"at s = {STAGE}", "verdict"), "dehydration")
    for one in clauses:
        sheet.add(one)
    told = {"head": sheet.head, "rows": sheet.rows}
    figures.keep("dehydration-claims", runs, "dehydration", stage=STAGE, whole=whole, clauses=told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, default=Path("out/claims"), help="where runs are kept, and found again")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--thinnest", type=float, default=0.03, help="thinnest skin of Figs. 7 to 10 [r1]")
    parser.add_argument("--thinnest-fruit", type=float, default=0.03, help="thinnest skin of Table 1 [r1]")
    parser.add_argument("--whole", action="store_true", help="the plans as they are written")
    parser.add_argument("--judge", action="store_true", help="run nothing")
    asked = parser.parse_args()
    store = Store.open(asked.store, create=True)
    wanted = {
        name: jobs(name, asked.seeds, asked.thinnest_fruit if name == "table1" else asked.thinnest, asked.whole)
        for name in PLANS
    }
    if not asked.judge:
        with executors.serial() as executor:
            for name, own in wanted.items():
                # what samples start from is run before them
                before = [plan.first for plan in plans(name) if asked.whole and plan.first is not None]
                for jobs_now in (*(plan.jobs() for plan in before), own):
                    print(f"{name}: {run_jobs(jobs_now, store, executor, name)}", flush=True)
    runs, patterns = [], {name: list[Pattern]() for name in PLANS}
    for name, own in wanted.items():
        for job in own:
            one = found(store, job)
            runs.append({"plan": name, "key": job.key, **(one._asdict() if one else {"missing": True})})
            patterns[name] += [one] if one else []
    keep(runs, judge(patterns), asked.whole)


if __name__ == "__main__":
    main()
