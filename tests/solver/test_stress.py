"""The quick part of the hostile matrix, and that a broken promise would be seen (`make stress` runs all of it)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from benchmarks.dehydration.stress.judged import Case, judge
from benchmarks.dehydration.stress.matrix import matrix
from solver.contract import Unstable
from solver.dehydration import run as run_module
from solver.dehydration.path import Path

CALM = Case("calm", "one stage", {"te": 0.2, "gamma": 3}, stages=(0.01,), n=4)


def test_the_matrix_is_large_and_every_case_has_its_name() -> None:
    cases = matrix()
    assert len(cases) >= 100
    assert len({(case.group, case.what) for case in cases}) == len(cases)


@pytest.mark.parametrize("case", matrix(quick=True), ids=lambda case: f"{case.group}: {case.what}")
def test_hostile_runs_keep_their_promises(case: Case) -> None:
    row = judge(case)
    assert row.good, f"{row.outcome}: {row.detail}"


def test_the_run_is_the_solvers_own_again_afterwards() -> None:
    before = run_module.Path, run_module.choose
    assert judge(CALM).outcome == "converged"
    assert (run_module.Path, run_module.choose) == before


def test_broken_promises_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    settle = Path._settle

    def ends(find: Any) -> str:
        with monkeypatch.context() as patch:
            patch.setattr(Path, "_settle", find)
            return judge(dataclasses.replace(CALM, stages=(0.01, 0.02))).outcome

    def folded(path: Path, state: Any, *rest: Any) -> Any:
        found = settle(path, state, *rest)
        state[path.mesh.surface_nodes[0]] = state[path.mesh.surface_nodes[0] - 2]
        state[path.mesh.surface_nodes[0], 1] -= 2**25
        return found

    def late(path: Path, state: Any, velocity: Any, rest: Any, shrinkage: float) -> Any:
        if shrinkage > 0.01:
            raise Unstable("it blew up.", advice="Ask for less.")
        return settle(path, state, velocity, rest, shrinkage)

    def defect(*_: Any) -> Any:
        raise ZeroDivisionError

    assert ends(folded) == "inverted"
    assert ends(late) == "unstable"
    assert ends(defect) == "untyped"
    assert ends(lambda *args: dataclasses.replace(settle(*args), residual=np.nan)) == "not finite"
