"""Whether a plan is expected to fit into the time allowed counts what it has to solve, and nothing else."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import xarray as xr

from solver.contract import OverBudget
from store import starter
from store.store import Store
from sweeps.planning.afford import afford
from sweeps.planning.plan import Plan

EXAMPLE = Path(__file__).parents[2] / "examples" / "starter.toml"


def test_a_pattern_that_comes_with_the_package_takes_no_time(tmp_path, monkeypatch):
    plan = Plan.parse(tomllib.loads(EXAMPLE.read_text()), "starter")
    assert plan.first is not None
    first, *others = (sum(plan.solver.cost(p, part.need).seconds for p in part.samples) for part in plan.parts())
    monkeypatch.setattr(starter, "ROOT", tmp_path / "package")
    package = Store.open(starter.ROOT, create=True)
    seconds = sum(others) + first / 2
    with pytest.raises(OverBudget):
        afford(plan, tmp_path / "own", seconds, None)
    package.put(next(iter(plan.first.jobs())).key, xr.Dataset())
    afford(plan, tmp_path / "own", seconds, None)


def test_what_runs_first_is_said_and_an_empty_folder_is_a_new_store(tmp_path, monkeypatch):
    plan = Plan.parse(tomllib.loads(EXAMPLE.read_text()), "starter")
    first, *others = (sum(plan.solver.cost(p, part.need).seconds for p in part.samples) for part in plan.parts())
    monkeypatch.setattr(starter, "ROOT", Store.open(tmp_path / "package", create=True).root)
    with pytest.raises(OverBudget, match="those before take about"):
        afford(plan, tmp_path, first + others[0] / 2, None)
    afford(plan, tmp_path, 1.1 * (first + sum(others)), None)


def test_workers_need_memory_together(tmp_path):
    """And time as if one did it all: they share the cores."""
    tables = {"solver": "dehydration", "axes": {"te": [0.06, 0.08, 0.1]}, "need": {"quality": "preview"}}
    plan = Plan.parse(tables)
    costs = [plan.solver.cost(params, plan.need) for params in plan.samples]
    seconds, two = 1.01 * sum(cost.seconds for cost in costs), sum(sorted(cost.bytes for cost in costs)[1:])
    afford(plan, tmp_path, seconds, None, 2, two)
    with pytest.raises(OverBudget, match=r"3 runs at once .* --workers 2"):
        afford(plan, tmp_path, seconds, None, 8, two)
    with pytest.raises(OverBudget, match="one after the other"):
        afford(plan, tmp_path, 0.9 * seconds, None, 2)
