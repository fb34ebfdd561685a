from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from store import tables
from store.store import Store
from sweeps import executors, refine
from sweeps.plan import Plan, units_of
from sweeps.rounds import Round, held_out_error, rounds
from sweeps.runner import run_plan

NEED = {"stages": [0.2], "quality": "fine", "fields": ["displacement", "mean_radius"]}
BOX = {"te": {"from": 0.02, "to": 0.06}, "gamma": {"from": 10, "to": 200, "scale": "log"}}
SCATTERED = {"solver": "ridged", "axes": BOX, "sampling": {"kind": "sobol", "count": 10}, "need": NEED}
GRID = {"solver": "ridged", "axes": {"te": [0.02, 0.06], "gamma": [10, 25, 70, 200]}, "need": NEED}


def made(root: Path, tables_: Mapping[str, object]) -> tuple[Store, Plan]:
    """Return a store with the runs of a plan and their table."""
    store, plan = Store.open(root, create=True), Plan.parse(tables_)
    sweep(store, plan)
    solver = plan.solver
    tables.build(store, solver=solver.name, axes=solver.params.axes, units=units_of(solver.name))
    return store, plan


def sweep(store: Store, plan: Plan) -> None:
    with executors.serial() as pool:
        assert run_plan(plan, store, pool).complete


def held_out(root: Path) -> Path:
    box = {"te": {"from": 0.026, "to": 0.055}, "gamma": {"from": 15, "to": 150, "scale": "log"}}
    many = {**SCATTERED, "axes": box, "sampling": {"kind": "sobol", "count": 16, "seed": 5}, "name": "held"}
    sweep(Store.open(root, create=True), Plan.parse(many))
    return root


def refined(store: Store, plan: Plan, count: int, held: Path | None = None) -> list[Round]:
    with executors.serial() as pool:
        return list(rounds(plan, store, "default", pool, count, "L2nr", held))


def at_random(store: Store, plan: Plan, count: int, seed: int) -> None:
    """Add points of the table's box without looking at errors."""
    state, draw = refine.read(store, "default", "L2nr"), np.random.default_rng(seed)
    points = [state.samples.unscale(draw.random(2)).tolist() for _ in range(count)]
    more = refine.with_samples(plan, [plan.solver.parse(dict(zip(state.table.axes, p, strict=True))) for p in points])
    sweep(store, more)
    tables.rebuild(store, more=[job.key for job in more.jobs()])


def test_the_error_falls_and_faster_than_at_random(site: None, tmp_path: Path) -> None:
    held = held_out(tmp_path / "held")
    store, plan = made(tmp_path / "refined", SCATTERED)
    base = shutil.copytree(store.root, tmp_path / "base")
    found = refined(store, plan, 8, held)
    errors = [one.held_out or 0.0 for one in found]
    assert [one.added for one in found] == list(range(9))
    blind = []
    for seed in range(4):
        other = Store.open(shutil.copytree(base, tmp_path / f"random{seed}"))
        at_random(other, plan, 8, seed)
        blind.append(held_out_error(other, "default", held, "L2nr"))
    print("refined", [f"{error:.3f}" for error in errors], "at random", [f"{error:.3f}" for error in blind])
    assert errors[-1] < 0.75 * errors[0]
    assert errors[-1] < np.mean(blind)
