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
