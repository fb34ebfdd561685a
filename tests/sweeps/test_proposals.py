"""Proposals go where the samples say that they are worst."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from store import tables
from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.refining import refine
from sweeps.running import executors
from sweeps.running.runner import run_plan

TABLE = {
    "solver": "ridged",
    "axes": {"te": {"from": 0.02, "to": 0.06}, "gamma": {"from": 10, "to": 200, "scale": "log"}},
    "sampling": {"kind": "sobol", "count": 16},
    "need": {"stages": [0.2], "quality": "fine", "fields": ["displacement", "mean_radius"]},
}


def test_the_first_proposal_is_beside_the_sample_that_is_predicted_worst(site: None, tmp_path: Path) -> None:
    """Whichever of them it is; and where all are equally bad, in the widest gap."""
    store, plan = Store.open(tmp_path / "store", create=True), Plan.parse(TABLE)
    with executors.serial() as pool:
        assert run_plan(plan, store, pool).complete
    tables.build(store, plan.solver)
    state = refine.read(store, "default", "L2nr")
    known, count = state.samples.points, len(state.errors)
    assert count == 16
    for worst in range(count):
        errors = np.where(np.arange(count) == worst, 1.0, 1e-3)
        proposal = next(refine.propose(plan, replace(state, errors=errors)))
        assert proposal.expected > 2 * errors.mean()
        place = state.samples.scale(np.array([proposal.points[0][axis] for axis in state.table.axes]))
        away = np.linalg.norm(known - place, axis=1)
        assert away[worst] <= np.sort(away)[2]
    even = next(refine.propose(plan, replace(state, errors=np.ones(count))))
    place = state.samples.scale(np.array([even.points[0][axis] for axis in state.table.axes]))
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 60)] * 2), -1).reshape(-1, 2)
    widest = np.linalg.norm(grid[:, None] - known, axis=-1).min(axis=1).max()
    assert np.linalg.norm(known - place, axis=1).min() > 0.9 * widest
